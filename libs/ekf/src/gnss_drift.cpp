#include "gnss_drift.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace vestibule::ekf {
namespace {

constexpr double kWhiteShare = 0.2;  ///< of sigma: what changes from fix to fix
constexpr double kWayError = 0.05;   ///< [-] of the way by odometry, in any direction

double squared(double v) { return v * v; }

}  // namespace

double GnssDrift::nis(const Fix& fix, double yaw_map_odom_rad, const Noise& noise) const {
  const Eigen::Rotation2Dd R_map_odom(yaw_map_odom_rad);
  double largest = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    const Fix& then = fixes_[i];
    const double age_s = toSeconds(fix.stamp - then.stamp);
    if (age_s > window_s_) continue;
    const Eigen::Vector2d way = R_map_odom * (fix.p_odom - then.p_odom);
    const double common = std::exp(-age_s / noise.correlation_s);
    const double variance = 2.0 * squared(noise.sigma_m) * (1.0 - common + squared(kWhiteShare)) +
                            way.squaredNorm() * (squared(noise.yaw_sigma_rad) + squared(kWayError));
    largest = std::max(largest, (fix.p_map - then.p_map - way).squaredNorm() / variance);
  }
  return largest;
}

void GnssDrift::good(const Fix& fix) {
  const Fix& newest = fixes_[(next_ + kMost - 1) % kMost];
  if (count_ > 0 && toSeconds(fix.stamp - newest.stamp) < window_s_ / kMost) return;
  fixes_[next_] = fix;
  next_ = (next_ + 1) % kMost;
  count_ = std::min(count_ + 1, kMost);
}

}  // namespace vestibule::ekf
