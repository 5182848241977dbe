#include "vestibule/grid/correlative.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::grid {
namespace {

// A square of poses is bounded by the maxima over 4 x 4 cells: poses up to two cells apart, each
// interpolating between two cells per axis.
constexpr int kBoundLevel = 2;
constexpr double kSquareCells = 2.0;
// Poses whose response is smaller than exp(-this) of the best change nothing that matters.
constexpr double kNegligible = 10.0;

/// Poses i_begin <= i < i_end, j_begin <= j < j_end of the lattice at one yaw.
struct Square {
  double bound = 0.0;  // of the log response
  int k = 0;
  int i_begin = 0, i_end = 0;
  int j_begin = 0, j_end = 0;
};

struct LatticePose {
  double log_response = 0.0;
  int i = 0, j = 0, k = 0;
};

}  // namespace

CorrelativeMatcher::CorrelativeMatcher(const CorrelativeParams& params) : params_(params) {
  for (std::size_t byte = 0; byte < log_of_byte_.size(); ++byte) {
    const double score = static_cast<double>(byte) / ScoreField::kOne;
    log_of_byte_[byte] =
        static_cast<float>(std::log(params.random_share + (1.0 - params.random_share) * score));
  }
}

void describe(ParamIo& io, CorrelativeParams& p) {
  io.optional("half_window_m", p.half_window_m, positive());
  io.optionalDegrees("half_window_deg", p.half_window_rad, positive());
  io.optional("step_m", p.step_m, positive());
  io.optionalDegrees("step_deg", p.step_rad, positive());
  io.optional("random_share", p.random_share, inside(0.0, 1.0));
  io.optional("effective_points", p.effective_points, positive());
}

std::optional<CorrelativeMatch> CorrelativeMatcher::match(
    const ScoreField& field,
    const std::vector<Point2>& points_base,
    const Pose2& T_map_guess,
    const std::optional<PosePrior>& prior) const {
  std::vector<Point2> points;
  for (const Point2& p : points_base) {
    if (std::hypot(p.x, p.y) <= field.reach()) points.push_back(p);
  }
  if (points.empty()) return std::nullopt;

  const double res = field.resolution();
  const double step = params_.step_m / res;  // in cells
  const Pose2 guess = between(field.T_map_field(), T_map_guess);
  const int n_xy = static_cast<int>(std::floor(params_.half_window_m / params_.step_m + 1e-9));
  const int n_yaw = static_cast<int>(std::floor(params_.half_window_rad / params_.step_rad + 1e-9));
  const double per_point = params_.effective_points / static_cast<double>(points.size());
  const auto cellX = [&](double u) {
    return std::clamp(
        static_cast<int>(std::floor(u)), -field.padding(), field.width() + field.padding() - 2);
  };
  const auto cellY = [&](double v) {
    return std::clamp(
        static_cast<int>(std::floor(v)), -field.padding(), field.height() + field.padding() - 2);
  };
  const auto poseOf = [&](int i, int j, int k) {
    return compose(
        field.T_map_field(),
        Pose2{
            guess.x + i * params_.step_m,
            guess.y + j * params_.step_m,
            guess.phi + k * params_.step_rad});
  };

  // Where the points lie at each yaw, in cells, less half a cell: from cell centre to cell centre.
  std::vector<std::vector<Point2>> turned;
  for (int k = -n_yaw; k <= n_yaw; ++k) {
    const Pose2 T{guess.x, guess.y, guess.phi + k * params_.step_rad};
    std::vector<Point2> at_yaw;
    for (const Point2& p : points) {
      const Point2 q = transform(T, p);
      at_yaw.push_back({q.x / res - 0.5, q.y / res - 0.5});
    }
    turned.push_back(std::move(at_yaw));
  }

  const int side = std::max(1, static_cast<int>(std::floor(kSquareCells / step + 1e-9)) + 1);
  std::vector<Square> squares;
  for (int k = -n_yaw; k <= n_yaw; ++k) {
    const auto& at_yaw = turned[static_cast<std::size_t>(k + n_yaw)];
    for (int j = -n_xy; j <= n_xy; j += side) {
      for (int i = -n_xy; i <= n_xy; i += side) {
        float sum = 0.0F;
        for (const Point2& p : at_yaw) {
          sum +=
              log_of_byte_[field.value(kBoundLevel, cellX(p.x + i * step), cellY(p.y + j * step))];
        }
        squares.push_back(
            {per_point * static_cast<double>(sum) + 1e-4,  // rounding of the sums
             k,
             i,
             std::min(i + side, n_xy + 1),
             j,
             std::min(j + side, n_xy + 1)});
      }
    }
  }
  std::stable_sort(squares.begin(), squares.end(), [](const Square& a, const Square& b) {
    return a.bound > b.bound;
  });

  std::vector<LatticePose> poses;
  LatticePose best;
  best.log_response = -1e300;
  for (const Square& square : squares) {
    if (square.bound < best.log_response - kNegligible) break;
    const auto& at_yaw = turned[static_cast<std::size_t>(square.k + n_yaw)];
    for (int j = square.j_begin; j < square.j_end; ++j) {
      for (int i = square.i_begin; i < square.i_end; ++i) {
        float sum = 0.0F;
        for (const Point2& p : at_yaw) {
          const double u = p.x + i * step;
          const double v = p.y + j * step;
          const int ix = cellX(u);
          const int iy = cellY(v);
          const auto fx = static_cast<float>(std::clamp(u - ix, 0.0, 1.0));
          const auto fy = static_cast<float>(std::clamp(v - iy, 0.0, 1.0));
          const std::uint8_t* c = field.level(0) + field.index(ix, iy);
          const std::uint8_t* above = c + field.stride();
          const float low = (1.0F - fx) * log_of_byte_[c[0]] + fx * log_of_byte_[c[1]];
          const float high = (1.0F - fx) * log_of_byte_[above[0]] + fx * log_of_byte_[above[1]];
          sum += (1.0F - fy) * low + fy * high;
        }
        LatticePose pose{per_point * static_cast<double>(sum), i, j, square.k};
        if (prior) {
          const Pose2 T = poseOf(i, j, square.k);
          const Eigen::Vector3d e(
              T.x - prior->T_map_base.x,
              T.y - prior->T_map_base.y,
              angleDiff(T.phi, prior->T_map_base.phi));
          pose.log_response -= 0.5 * std::min(e.dot(prior->information * e), prior->max_d2);
        }
        poses.push_back(pose);
        if (pose.log_response > best.log_response) best = pose;
      }
    }
  }

  CorrelativeMatch match;
  match.T_map_base = poseOf(best.i, best.j, best.k);
  match.at_edge = std::abs(best.i) == n_xy || std::abs(best.j) == n_xy || std::abs(best.k) == n_yaw;
  for (const Point2& p : points) match.score += field.at(transform(match.T_map_base, p));
  match.score /= static_cast<double>(points.size());

  // Moments of the response about the best pose, in field axes (Olson 2009, section IV).
  double s = 0.0;
  Eigen::Vector3d u = Eigen::Vector3d::Zero();
  Eigen::Matrix3d K = Eigen::Matrix3d::Zero();
  for (const LatticePose& pose : poses) {
    const double w = std::exp(pose.log_response - best.log_response);
    const Eigen::Vector3d x(
        (pose.i - best.i) * params_.step_m,
        (pose.j - best.j) * params_.step_m,
        (pose.k - best.k) * params_.step_rad);
    s += w;
    u += w * x;
    K += w * x * x.transpose();
  }
  const Eigen::Vector3d mean = u / s;
  Eigen::Matrix3d cov = K / s - mean * mean.transpose();
  // The lattice itself cannot tell poses within a step apart.
  cov.diagonal() += Eigen::Vector3d(
                        params_.step_m * params_.step_m,
                        params_.step_m * params_.step_m,
                        params_.step_rad * params_.step_rad) /
                    12.0;
  const Pose2 T_field_best = between(field.T_map_field(), match.T_map_base);
  match.response = compose(
      field.T_map_field(),
      PoseWithCovariance{
          {T_field_best.x + mean.x(),
           T_field_best.y + mean.y(),
           wrapToPi(T_field_best.phi + mean.z())},
          cov});
  return match;
}

}  // namespace vestibule::grid
