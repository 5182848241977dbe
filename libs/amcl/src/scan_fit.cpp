#include "scan_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace vestibule::amcl {
namespace {

constexpr double kFar_m = 1.0;          // distances are cut here: nothing to be attracted by
constexpr double kAttraction_m = 0.60;  // ends farther from any obstacle hit something unmapped
constexpr int kIterations = 8;
constexpr double kNeighbour_m = 0.20;
constexpr double kNeighbourSteps = 3.0;
// A ray along a wall may clip it by a little. It is blocked only if its neighbours on both sides
// are, too, well before its end.
constexpr double kRaySide_m = 0.10;
constexpr double kRayMargin_m = 0.30;

}  // namespace

std::vector<Point2> spreadEnds(
    const LaserScan& scan, double max_range_m, double spacing_m, std::size_t count) {
  const std::size_t n = scan.ranges_m.size();
  std::vector<Point2> ends(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto range = static_cast<double>(scan.ranges_m[i]);
    ends[i] = transform(
        scan.T_base_laser, {range * std::cos(scan.angle(i)), range * std::sin(scan.angle(i))});
  }
  const auto usable = [&](std::size_t i) {
    return scan.valid(i) && static_cast<double>(scan.ranges_m[i]) <= max_range_m;
  };
  // A surface is hit by neighbouring beams; a lone end is dust, an edge or an error.
  const auto has_neighbour = [&](std::size_t i) {
    const double reach_m = std::max(
        kNeighbour_m,
        kNeighbourSteps * std::abs(scan.angle_step_rad) * static_cast<double>(scan.ranges_m[i]));
    for (const std::size_t j : {i - 2, i - 1, i + 1, i + 2}) {
      if (j >= n || !usable(j)) continue;  // i - 1 wraps round to a large number
      if (std::hypot(ends[i].x - ends[j].x, ends[i].y - ends[j].y) < reach_m) return true;
    }
    return false;
  };
  std::vector<Point2> spaced;
  for (std::size_t i = 0; i < n; ++i) {
    if (!usable(i) || !has_neighbour(i)) continue;
    if (!spaced.empty() &&
        std::hypot(ends[i].x - spaced.back().x, ends[i].y - spaced.back().y) < spacing_m) {
      continue;
    }
    spaced.push_back(ends[i]);
  }
  if (spaced.size() <= count) return spaced;
  std::vector<Point2> chosen;
  for (std::size_t k = 0; k < count; ++k) chosen.push_back(spaced[k * spaced.size() / count]);
  return chosen;
}

ScanFitter::ScanFitter(const GlobalParams& params, const grid::OccupancyMap& map)
    : params_(params),
      distances_(map),
      rays_(map),
      width_(map.width()),
      height_(map.height()),
      resolution_m_(map.resolution()),
      T_map_cells_(compose(map.T_map_grid(), Pose2{map.corner().x, map.corner().y, 0.0})) {}

ScanFitter::Distance ScanFitter::interpolated(const Point2& p_grid) const {
  const double u = p_grid.x / resolution_m_ - 0.5;
  const double v = p_grid.y / resolution_m_ - 0.5;
  const std::vector<float>& d = distances_.cells();
  if (d.empty() || !(u >= 0.0 && v >= 0.0 && u < width_ - 1 && v < height_ - 1)) {
    return {kFar_m, 0.0, 0.0};
  }
  const auto ix = static_cast<std::size_t>(u);
  const auto iy = static_cast<std::size_t>(v);
  const double fx = u - static_cast<double>(ix);
  const double fy = v - static_cast<double>(iy);
  const float* row = d.data() + iy * static_cast<std::size_t>(width_) + ix;
  const auto d00 = static_cast<double>(row[0]);
  const auto d10 = static_cast<double>(row[1]);
  const auto d01 = static_cast<double>(row[width_]);
  const auto d11 = static_cast<double>(row[width_ + 1]);
  return {
      (1.0 - fy) * ((1.0 - fx) * d00 + fx * d10) + fy * ((1.0 - fx) * d01 + fx * d11),
      ((1.0 - fy) * (d10 - d00) + fy * (d11 - d01)) / resolution_m_,
      ((1.0 - fx) * (d01 - d00) + fx * (d11 - d10)) / resolution_m_};
}

PoseWithCovariance ScanFitter::refined(
    const std::vector<Point2>& ends_base,
    const Pose2& T_map_base,
    const Eigen::Matrix3d& information) const {
  // In cell axes, where the gradients live.
  const Pose2 T_cells_map = inverse(T_map_cells_);
  const Eigen::Matrix3d info_cells =
      compose(T_cells_map, PoseWithCovariance{T_map_base, information}).cov;
  const Pose2 start = compose(T_cells_map, T_map_base);
  Pose2 T = start;
  const double sigma2 = params_.sigma_hit_m * params_.sigma_hit_m;
  const double tempering = params_.surface_share;
  Eigen::Matrix3d H = info_cells;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const double c = std::cos(T.phi);
    const double s = std::sin(T.phi);
    const Eigen::Vector3d off(T.x - start.x, T.y - start.y, angleDiff(T.phi, start.phi));
    Eigen::Vector3d g = info_cells * off;
    H = info_cells;
    for (const Point2& p : ends_base) {
      const Point2 q{T.x + c * p.x - s * p.y, T.y + s * p.x + c * p.y};
      const Distance d = interpolated(q);
      if (d.d_m >= kAttraction_m) continue;
      const double ratio = 3.0 * params_.sigma_hit_m / std::max(d.d_m, 1e-9);
      const double weight = tempering / sigma2 * std::min(1.0, ratio * ratio);
      const Eigen::Vector3d J(d.gx, d.gy, d.gx * (T.y - q.y) + d.gy * (q.x - T.x));
      H += weight * J * J.transpose();
      g += weight * d.d_m * J;
    }
    const Eigen::Matrix3d damped =
        H + Eigen::Vector3d(1e-3, 1e-3, 1e-3).asDiagonal().toDenseMatrix();
    const Eigen::Vector3d step = -damped.ldlt().solve(g);
    T = {T.x + step.x(), T.y + step.y(), wrapToPi(T.phi + step.z())};
    if (step.head<2>().norm() < 1e-3 && std::abs(step.z()) < 1e-4) break;
  }
  // Directions that neither scan nor information hold are known to a metre and some degrees.
  const Eigen::Matrix3d weak = Eigen::Vector3d(1.0, 1.0, 30.0).asDiagonal();
  return compose(T_map_cells_, PoseWithCovariance{T, (H + weak).inverse()});
}

ScanFit ScanFitter::fit(
    const std::vector<Point2>& ends_base,
    const std::vector<double>& news,
    const Point2& p_base_laser,
    const Pose2& T_map_base) const {
  ScanFit fit;
  if (ends_base.empty()) return fit;
  const Pose2 T_cells_base = compose(inverse(T_map_cells_), T_map_base);
  const Point2 p_map_laser = transform(T_map_base, p_base_laser);
  const double n = static_cast<double>(ends_base.size());
  const double log_blocked = std::log(params_.blocked_share);
  for (std::size_t i = 0; i < ends_base.size(); ++i) {
    const Point2& p = ends_base[i];
    const double is_new = news.empty() ? 1.0 : news[i];
    const Point2 ray{p.x - p_base_laser.x, p.y - p_base_laser.y};
    const double length = std::hypot(ray.x, ray.y);
    const double yaw = std::atan2(ray.y, ray.x) + T_map_base.phi;
    const double reach_m = length - kRayMargin_m;
    double passed_m = 0.0;  // of the ray that gets farthest
    for (const double side_m : {0.0, kRaySide_m, -kRaySide_m}) {
      if (reach_m <= passed_m) break;
      const Point2 from{
          p_map_laser.x - side_m * std::sin(yaw), p_map_laser.y + side_m * std::cos(yaw)};
      passed_m = std::max(passed_m, rays_.range(from, yaw, reach_m));
    }
    double log_likelihood = log_blocked;
    if (passed_m < reach_m) {
      fit.blocked_share += 1.0 / n;
    } else {
      const double d = interpolated(transform(T_cells_base, p)).d_m;
      const double u = d / params_.sigma_hit_m;
      if (d < params_.inlier_distance_m) fit.inlier_share += 1.0 / n;
      log_likelihood =
          std::log(params_.random_share + (1.0 - params_.random_share) * std::exp(-0.5 * u * u));
    }
    fit.log_likelihood += is_new * params_.surface_share * log_likelihood;
  }
  return fit;
}

}  // namespace vestibule::amcl
