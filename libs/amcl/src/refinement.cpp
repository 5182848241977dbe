#include "refinement.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule::amcl {
namespace {

constexpr double kConverged_m = 2e-4;
constexpr double kConverged_rad = 2e-5;
// One step goes no farther than the field is about linear.
constexpr double kLargestStep_m = 0.15;
constexpr double kLargestStep_rad = degToRad(4.0);

struct Normal {
  Eigen::Matrix4d H = Eigen::Matrix4d::Zero();
  Eigen::Vector4d g = Eigen::Vector4d::Zero();
  double weight = 0.0;
  double weighted_squares = 0.0;
  double log_likelihood = 0.0;  ///< of the beams, each against one on an obstacle
};

Normal linearise(
    const grid::DistanceField& field,
    const std::vector<Point2>& ends,
    const Point2& p_base_laser,
    const Pose2& T,
    double offset_m,
    double sigma_m,
    const RefinementParams& params) {
  const double c = std::cos(T.phi);
  const double s = std::sin(T.phi);
  const double inverse_2s2 = 0.5 / (sigma_m * sigma_m);
  const double log_clutter = std::log(params.clutter);
  Normal n;
  for (const Point2& p : ends) {
    const double rx = c * p.x - s * p.y;
    const double ry = s * p.x + c * p.y;
    const auto d = field.slopeAtGrid({T.x + rx, T.y + ry});
    if (!d || d->distance_m > params.max_distance_m) {
      n.log_likelihood += log_clutter;
      continue;
    }
    // The slope points away from the obstacle: against the beam on the side it comes from.
    const double along_x = rx - (c * p_base_laser.x - s * p_base_laser.y);
    const double along_y = ry - (s * p_base_laser.x + c * p_base_laser.y);
    const double side = d->gradient_x * along_x + d->gradient_y * along_y <= 0.0 ? 1.0 : -1.0;
    const double r = side * d->distance_m - offset_m;
    const double hit = std::exp(-r * r * inverse_2s2);
    const double w = hit / (hit + params.clutter);
    const Eigen::Vector4d J(
        side * d->gradient_x,
        side * d->gradient_y,
        side * (d->gradient_y * rx - d->gradient_x * ry),
        -1.0);
    n.H += w * J * J.transpose();
    n.g += w * r * J;
    n.weight += w;
    n.log_likelihood += std::log(hit + params.clutter);
    n.weighted_squares += w * r * r;
  }
  return n;
}

}  // namespace

Refinement refine(
    const grid::DistanceField& field,
    const std::vector<Point2>& ends,
    const Point2& p_base_laser,
    const TrackState& prior,
    const Pose2& start,
    double residual_sigma_m,
    const RefinementParams& params) {
  const Eigen::Matrix4d prior_information = prior.cov.inverse();
  // Beams are not independent: together they count as so many.
  const double temper = std::min(
      1.0, params.effective_beams / std::max<double>(1.0, static_cast<double>(ends.size())));
  const double scale = temper / (residual_sigma_m * residual_sigma_m);

  Refinement result;
  Pose2 T = start;
  double offset_m = prior.wall_offset_m;
  Normal n;
  Eigen::Matrix4d A = prior_information;
  for (int i = 0; i < params.iterations; ++i) {
    n = linearise(field, ends, p_base_laser, T, offset_m, residual_sigma_m, params);
    const Eigen::Vector4d from_prior(
        T.x - prior.T_grid_base.x,
        T.y - prior.T_grid_base.y,
        angleDiff(T.phi, prior.T_grid_base.phi),
        offset_m - prior.wall_offset_m);
    A = scale * n.H + prior_information;
    Eigen::Vector4d step = -A.ldlt().solve(scale * n.g + prior_information * from_prior);
    const double too_long =
        std::max(step.head<2>().norm() / kLargestStep_m, std::abs(step.z()) / kLargestStep_rad);
    if (too_long > 1.0) step /= too_long;
    T = {T.x + step.x(), T.y + step.y(), wrapToPi(T.phi + step.z())};
    offset_m += step.w();
    if (step.head<2>().norm() < kConverged_m && std::abs(step.z()) < kConverged_rad) {
      result.converged = true;
      break;
    }
  }
  const Eigen::Vector4d correction(
      T.x - prior.T_grid_base.x,
      T.y - prior.T_grid_base.y,
      angleDiff(T.phi, prior.T_grid_base.phi),
      offset_m - prior.wall_offset_m);
  result.correction_chi2 = correction.dot(prior_information * correction);
  // The density of a wide prior is low: it costs what a jump of the robot does.
  result.cost = -temper * n.log_likelihood + 0.5 * result.correction_chi2 -
                0.5 * std::log(prior_information.determinant());
  result.state = {T, offset_m, A.inverse()};
  result.scan_information = scale * n.H.topLeftCorner<3, 3>();
  result.fitting_share = ends.empty() ? 0.0 : n.weight / static_cast<double>(ends.size());
  result.residual_sigma_m =
      n.weight > 0.0 ? std::sqrt(n.weighted_squares / n.weight) : residual_sigma_m;
  return result;
}

}  // namespace vestibule::amcl
