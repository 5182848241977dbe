#include "vestibule/grid/correlative.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::grid {
namespace {

// The coarse lattice takes this many fine steps at once; a cell of it is refined where its response
// is within exp(-kRefineWithin) of the best coarse one.
constexpr int kCoarseSteps = 3;
constexpr int kCoarseYawSteps = 4;
constexpr double kRefineWithin = 4.0;

struct LatticePose {
  double log_response = 0.0;
  int i = 0, j = 0, k = 0;
  double volume = 1.0;  // in fine cells
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
  const float step = static_cast<float>(params_.step_m / res);  // in cells
  const Pose2 guess = between(field.T_map_field(), T_map_guess);
  const int n_xy = static_cast<int>(std::floor(params_.half_window_m / params_.step_m + 1e-9));
  const int n_yaw = static_cast<int>(std::floor(params_.half_window_rad / params_.step_rad + 1e-9));
  const double per_point = params_.effective_points / static_cast<double>(points.size());
  const auto poseOf = [&](int i, int j, int k) {
    return compose(
        field.T_map_field(),
        Pose2{
            guess.x + i * params_.step_m,
            guess.y + j * params_.step_m,
            guess.phi + k * params_.step_rad});
  };
  // Where the points lie at yaw step k, in cells from the centre of the padded corner cell.
  std::vector<Eigen::Vector2f> turned;
  const auto turn = [&](int k) {
    const Pose2 T{guess.x, guess.y, guess.phi + k * params_.step_rad};
    turned.clear();
    for (const Point2& p : points) {
      const Point2 q = transform(T, p);
      turned.emplace_back(
          static_cast<float>(q.x / res - 0.5 + field.padding()),
          static_cast<float>(q.y / res - 0.5 + field.padding()));
    }
  };
  // Beyond the padding lies nothing: such points stay in its outermost cells, which score 0.
  const auto x_max = static_cast<float>(field.width() + 2 * field.padding() - 2);
  const auto y_max = static_cast<float>(field.height() + 2 * field.padding() - 2);
  const auto evaluate = [&](int i, int j, int k, double volume) {
    float sum = 0.0F;
    for (const Eigen::Vector2f& p : turned) {
      const float u = std::clamp(p.x() + static_cast<float>(i) * step, 0.0F, x_max);
      const float v = std::clamp(p.y() + static_cast<float>(j) * step, 0.0F, y_max);
      const int ix = static_cast<int>(u);
      const int iy = static_cast<int>(v);
      const float fx = u - static_cast<float>(ix);
      const float fy = v - static_cast<float>(iy);
      const std::uint8_t* c = field.level(0) + static_cast<std::size_t>(iy) * field.stride() + ix;
      const std::uint8_t* above = c + field.stride();
      const float low = (1.0F - fx) * log_of_byte_[c[0]] + fx * log_of_byte_[c[1]];
      const float high = (1.0F - fx) * log_of_byte_[above[0]] + fx * log_of_byte_[above[1]];
      sum += (1.0F - fy) * low + fy * high;
    }
    LatticePose pose{per_point * static_cast<double>(sum), i, j, k, volume};
    if (prior) {
      const Pose2 T = poseOf(i, j, k);
      const Eigen::Vector3d e(
          T.x - prior->T_map_base.x,
          T.y - prior->T_map_base.y,
          angleDiff(T.phi, prior->T_map_base.phi));
      pose.log_response -= 0.5 * std::min(e.dot(prior->information * e), prior->max_d2);
    }
    return pose;
  };
  const auto better = [](const LatticePose& a, const LatticePose& b) {
    return a.log_response < b.log_response;
  };

  const int cells_xy = (n_xy + kCoarseSteps / 2) / kCoarseSteps;
  const int cells_yaw = (n_yaw + kCoarseYawSteps / 2) / kCoarseYawSteps;
  std::vector<LatticePose> coarse;
  for (int k = -cells_yaw; k <= cells_yaw; ++k) {
    turn(k * kCoarseYawSteps);
    for (int j = -cells_xy; j <= cells_xy; ++j) {
      for (int i = -cells_xy; i <= cells_xy; ++i) {
        coarse.push_back(evaluate(
            i * kCoarseSteps,
            j * kCoarseSteps,
            k * kCoarseYawSteps,
            kCoarseSteps * kCoarseSteps * kCoarseYawSteps));
      }
    }
  }
  const double refine_above =
      std::max_element(coarse.begin(), coarse.end(), better)->log_response - kRefineWithin;
  std::vector<LatticePose> poses;
  for (int k = -cells_yaw * kCoarseYawSteps - kCoarseYawSteps / 2;
       k < cells_yaw * kCoarseYawSteps + kCoarseYawSteps / 2;
       ++k) {
    // The coarse cells are in order of k, j, i.
    const int side = 2 * cells_xy + 1;
    const int layer = (k + kCoarseYawSteps / 2 + cells_yaw * kCoarseYawSteps) / kCoarseYawSteps;
    bool is_turned = false;
    for (int n = layer * side * side; n < (layer + 1) * side * side; ++n) {
      const LatticePose& cell = coarse[static_cast<std::size_t>(n)];
      if (cell.log_response < refine_above) {
        if (cell.k == k) poses.push_back(cell);
        continue;
      }
      if (!is_turned) turn(k);
      is_turned = true;
      for (int j = cell.j - kCoarseSteps / 2; j <= cell.j + kCoarseSteps / 2; ++j) {
        for (int i = cell.i - kCoarseSteps / 2; i <= cell.i + kCoarseSteps / 2; ++i) {
          poses.push_back(evaluate(i, j, k, 1.0));
        }
      }
    }
  }
  const LatticePose best = *std::max_element(poses.begin(), poses.end(), better);

  CorrelativeMatch match;
  match.T_map_base = poseOf(best.i, best.j, best.k);
  match.at_edge = std::max(std::abs(best.i), std::abs(best.j)) >= cells_xy * kCoarseSteps ||
                  std::abs(best.k) >= cells_yaw * kCoarseYawSteps;
  for (const Point2& p : points) match.score += field.at(transform(match.T_map_base, p));
  match.score /= static_cast<double>(points.size());

  // Moments of the response about the best pose, in field axes (Olson 2009, section IV).
  double s = 0.0;
  Eigen::Vector3d u = Eigen::Vector3d::Zero();
  Eigen::Matrix3d K = Eigen::Matrix3d::Zero();
  for (const LatticePose& pose : poses) {
    const double w = pose.volume * std::exp(pose.log_response - best.log_response);
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
