#include "alignment.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "vestibule/core/angles.hpp"

namespace vestibule::ekf {
namespace {

constexpr double kSpacing_m = 0.5;      ///< nearer fixes replace each other
constexpr std::size_t kMaxFixes = 200;  ///< the newest 100 m and more
constexpr int kReweightings = 10;
constexpr double kHuber = 1.5;              ///< in sigmas
constexpr double kMaxResidual = 2.0;        ///< rms in sigmas: beyond it the tracks do not agree
constexpr double kOdometryDrift = 0.05;     ///< [-] of the extent: scale, bias not yet known
constexpr double kOdometryYawSigma = 0.03;  ///< [rad] what the odometry itself bends meanwhile

}  // namespace

void TrackAlignment::add(
    Timestamp stamp,
    const Eigen::Vector2d& p_map_antenna,
    const Point2& p_odom_antenna,
    double sigma_m) {
  const Fix fix{stamp, p_map_antenna, {p_odom_antenna.x, p_odom_antenna.y}, sigma_m};
  if (!fixes_.empty() && (anchor_odom_ - fix.p_odom).norm() < kSpacing_m) {
    fixes_.back() = fix;
    return;
  }
  fixes_.push_back(fix);
  anchor_odom_ = fix.p_odom;
  if (fixes_.size() > kMaxFixes) fixes_.pop_front();
}

double TrackAlignment::extent() const {
  double extent_m = 0.0;
  for (const Fix& fix : fixes_) {
    extent_m = std::max(extent_m, (fix.p_odom - fixes_.back().p_odom).norm());
  }
  return extent_m;
}

std::optional<TrackAlignment::Result> TrackAlignment::solve() const {
  const std::size_t n = fixes_.size();
  const double extent_m = extent();
  if (n < static_cast<std::size_t>(params_->init.min_fixes) ||
      extent_m < params_->init.min_travel_m) {
    return std::nullopt;
  }

  // Carrier-phase fixes are better than the odometry they are compared with.
  std::vector<double> sigma_m(n);
  std::vector<double> weight(n);
  for (std::size_t i = 0; i < n; ++i) {
    sigma_m[i] = std::hypot(fixes_[i].sigma_m, kOdometryDrift * extent_m);
    weight[i] = 1.0 / (sigma_m[i] * sigma_m[i]);
  }
  Pose2 T_map_odom;
  double mean_square = 0.0;  // of the residuals in sigmas
  double spread_sq = 0.0;    // of the odometry track [m^2]
  double sigma_sq = 0.0;
  for (int iteration = 0; iteration < kReweightings; ++iteration) {
    double sum = 0.0;
    Eigen::Vector2d mean_map = Eigen::Vector2d::Zero();
    Eigen::Vector2d mean_odom = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < n; ++i) {
      sum += weight[i];
      mean_map += weight[i] * fixes_[i].p_map;
      mean_odom += weight[i] * fixes_[i].p_odom;
    }
    mean_map /= sum;
    mean_odom /= sum;
    double dot = 0.0;
    double cross = 0.0;
    spread_sq = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const Eigen::Vector2d a = fixes_[i].p_odom - mean_odom;
      const Eigen::Vector2d b = fixes_[i].p_map - mean_map;
      dot += weight[i] * a.dot(b);
      cross += weight[i] * (a.x() * b.y() - a.y() * b.x());
      spread_sq += weight[i] * a.squaredNorm() / sum;
    }
    const double yaw = std::atan2(cross, dot);
    const Point2 turned = transform(Pose2(0, 0, yaw), {mean_odom.x(), mean_odom.y()});
    T_map_odom = Pose2(mean_map.x() - turned.x, mean_map.y() - turned.y, yaw);

    mean_square = 0.0;
    sigma_sq = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const Point2 p = transform(T_map_odom, {fixes_[i].p_odom.x(), fixes_[i].p_odom.y()});
      const double residual =
          std::hypot(p.x - fixes_[i].p_map.x(), p.y - fixes_[i].p_map.y()) / sigma_m[i];
      const double plain = 1.0 / (sigma_m[i] * sigma_m[i]);
      weight[i] = residual > kHuber ? plain * kHuber / residual : plain;
      mean_square += 0.5 * residual * residual / static_cast<double>(n);
      sigma_sq += sigma_m[i] * sigma_m[i] / static_cast<double>(n);
    }
  }
  if (mean_square > kMaxResidual * kMaxResidual || spread_sq <= 0.0) return std::nullopt;

  // What of the slowly varying error differs between the ends of the track turns it; the rest of
  // the error shifts it. Seen residuals average out over the fixes.
  const double span_s = std::abs(toSeconds(fixes_.back().stamp - fixes_.front().stamp));
  const double differing_sq =
      2.0 * sigma_sq * (1.0 - std::exp(-span_s / params_->gnss.correlation_s));
  const double slow_sq = differing_sq / (extent_m * extent_m);
  const double white_sq = mean_square * sigma_sq / (static_cast<double>(n) * spread_sq);
  Result result;
  result.T_map_odom = T_map_odom;
  result.yaw_sigma_rad = std::sqrt(slow_sq + white_sq + kOdometryYawSigma * kOdometryYawSigma);
  result.position_sigma_m = std::sqrt(sigma_sq * std::max(1.0, mean_square));
  if (result.yaw_sigma_rad > params_->init.max_yaw_sigma_rad) return std::nullopt;
  return result;
}

}  // namespace vestibule::ekf
