#include "vestibule/geo/georeference.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule::geo {
namespace {

constexpr int kIterations = 20;
constexpr double kScale = 3.0;  // [sigmas] beyond it a pair hardly counts

Eigen::Vector2d residual(const Pose2& T, const GeoPair& pair) {
  const Point2 p = transform(T, pair.p_grid);
  return {pair.p_enu.x() - p.x, pair.p_enu.y() - p.y};
}

/// Weighted rigid fit in closed form.
Pose2 fitRigid(const std::vector<GeoPair>& pairs, const std::vector<double>& weights) {
  double sum = 0.0;
  Eigen::Vector2d mean_enu = Eigen::Vector2d::Zero();
  Eigen::Vector2d mean_grid = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    sum += weights[i];
    mean_enu += weights[i] * pairs[i].p_enu;
    mean_grid += weights[i] * Eigen::Vector2d(pairs[i].p_grid.x, pairs[i].p_grid.y);
  }
  mean_enu /= sum;
  mean_grid /= sum;
  double along = 0.0;
  double across = 0.0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Vector2d a = Eigen::Vector2d(pairs[i].p_grid.x, pairs[i].p_grid.y) - mean_grid;
    const Eigen::Vector2d b = pairs[i].p_enu - mean_enu;
    along += weights[i] * a.dot(b);
    across += weights[i] * (a.x() * b.y() - a.y() * b.x());
  }
  const double yaw = std::atan2(across, along);
  const Point2 turned = transform({0.0, 0.0, yaw}, {mean_grid.x(), mean_grid.y()});
  return {mean_enu.x() - turned.x, mean_enu.y() - turned.y, yaw};
}

}  // namespace

std::optional<GeoreferenceFit> fitGeoreference(
    const std::vector<GeoPair>& pairs, double pairs_per_error, double min_span_m) {
  if (pairs.size() < 3) return std::nullopt;
  double span = 0.0;
  for (const GeoPair& pair : pairs) {
    span = std::max(
        span, std::hypot(pair.p_grid.x - pairs[0].p_grid.x, pair.p_grid.y - pairs[0].p_grid.y));
  }
  if (span < min_span_m) return std::nullopt;

  std::vector<double> weights;
  for (const GeoPair& pair : pairs) weights.push_back(1.0 / (pair.sigma_m * pair.sigma_m));
  GeoreferenceFit fit;
  Pose2& T = fit.T_map_grid.mean;
  T = fitRigid(pairs, weights);
  std::vector<double> robust(pairs.size(), 1.0);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const double sigma = pairs[i].sigma_m;
      const double r2 = residual(T, pairs[i]).squaredNorm() / (kScale * kScale * sigma * sigma);
      robust[i] = 1.0 / ((1.0 + r2) * (1.0 + r2));
      weights[i] = robust[i] / (sigma * sigma);
    }
    T = fitRigid(pairs, weights);
  }
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  double squares = 0.0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Point2 turned = transform({0.0, 0.0, T.phi}, pairs[i].p_grid);
    Eigen::Matrix<double, 2, 3> J;
    J << 1.0, 0.0, -turned.y, 0.0, 1.0, turned.x;
    H += weights[i] * J.transpose() * J;
    if (robust[i] < 0.5) continue;
    ++fit.used;
    squares += residual(T, pairs[i]).squaredNorm();
  }
  if (fit.used < 3) return std::nullopt;
  fit.T_map_grid.cov = std::max(1.0, pairs_per_error) * H.inverse();
  fit.rms_m = std::sqrt(squares / static_cast<double>(fit.used));
  return fit;
}

}  // namespace vestibule::geo
