#include "scan_continuity.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule::amcl {
namespace {

constexpr double kMaxGap_s = 1.0;
constexpr double kMaxWay_m = 0.5;
constexpr double kMaxTurn_rad = degToRad(60.0);
constexpr double kNear_m = 0.3;
constexpr double kNearPerM = 0.05;  // odometry lags behind the scans by some degrees
constexpr std::size_t kBeams = 120;
constexpr int kFewest = 30;
constexpr double kBroken = 0.4;  // share of ends; driving on keeps 0.6 and more of them
constexpr int kBrokenScans = 2;  // one alone may be covered

}  // namespace

std::optional<double> ScanContinuity::agreement(
    const LaserScan& earlier, const LaserScan& later, const Pose2& T_earlier_later) {
  const std::size_t n = later.ranges_m.size();
  const std::size_t m = earlier.ranges_m.size();
  const std::size_t step = std::max<std::size_t>(1, n / kBeams);
  const Pose2 T_earlier_laser =
      compose(inverse(earlier.T_base_laser), compose(T_earlier_later, later.T_base_laser));
  int seen = 0;
  int agreeing = 0;
  for (std::size_t i = 0; i < n; i += step) {
    if (!later.valid(i)) continue;
    const auto range_m = static_cast<double>(later.ranges_m[i]);
    const Point2 end = transform(
        T_earlier_laser, {range_m * std::cos(later.angle(i)), range_m * std::sin(later.angle(i))});
    double off = wrapToPi(std::atan2(end.y, end.x) - earlier.angle_min_rad);
    if (off * earlier.angle_step_rad < 0.0) off += std::copysign(2.0 * kPi, earlier.angle_step_rad);
    const double at = off / earlier.angle_step_rad;
    if (!(at >= 0.0 && at <= static_cast<double>(m - 1))) continue;
    ++seen;
    const double away_m = std::hypot(end.x, end.y);
    const auto middle = static_cast<std::size_t>(std::lround(at));
    const std::size_t last = std::min(m - 1, middle + 1);
    for (std::size_t j = middle > 0 ? middle - 1 : 0; j <= last; ++j) {
      if (!earlier.valid(j)) continue;
      if (std::abs(static_cast<double>(earlier.ranges_m[j]) - away_m) <
          kNear_m + kNearPerM * away_m) {
        ++agreeing;
        break;
      }
    }
  }
  if (seen < kFewest) return std::nullopt;
  return static_cast<double>(agreeing) / seen;
}

void ScanContinuity::restart() {
  before_.reset();
  broken_ = 0;
}

bool ScanContinuity::breaks(const LaserScan& scan, const Pose2& T_odom_base) {
  if (scan.ranges_m.empty()) return false;
  if (before_) {
    const Pose2 T = between(before_->T_odom_base, T_odom_base);
    const double gap_s = toSeconds(scan.stamp - before_->scan.stamp);
    const bool soon = gap_s >= 0.0 && gap_s < kMaxGap_s && translationNorm(T) < kMaxWay_m &&
                      std::abs(T.phi) < kMaxTurn_rad;
    const auto share = soon ? agreement(before_->scan, scan, T) : std::nullopt;
    if (share && *share < kBroken) {
      if (++broken_ < kBrokenScans) return false;
      restart();
      return true;
    }
  }
  broken_ = 0;
  before_ = Seen{scan, T_odom_base};
  return false;
}

}  // namespace vestibule::amcl
