#include "vestibule/mapping/deskew.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "vestibule/core/angles.hpp"

namespace vestibule::mapping {
namespace {

/// Neighbouring end points this much farther apart than their ranges' mean belong to two surfaces.
constexpr double kSameSurface = 0.1;

}  // namespace

LaserScan deskewed(const LaserScan& scan, double speed_mps, double yaw_rate_radps) {
  const std::size_t n = scan.ranges_m.size();
  if (scan.time_increment_s == 0.0 || n < 2) return scan;

  struct Polar {
    double angle;  // continuous along the scan, in the laser frame at the stamp
    double range;
    bool valid;
  };
  const Pose2 T_laser_base = inverse(scan.T_base_laser);
  std::vector<Polar> moved(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double t = static_cast<double>(i) * scan.time_increment_s;
    const Pose2 T_base_then = expSe2({speed_mps * t, 0.0, yaw_rate_radps * t});
    const double expected = scan.angle(i) + yaw_rate_radps * t;
    moved[i] = {expected, 0.0, scan.valid(i)};
    if (!moved[i].valid) continue;
    const auto range = static_cast<double>(scan.ranges_m[i]);
    const Pose2 T_then_laser = scan.T_base_laser;
    const Point2 p = transform(
        compose(T_laser_base, compose(T_base_then, T_then_laser)),
        {range * std::cos(scan.angle(i)), range * std::sin(scan.angle(i))});
    moved[i].angle = expected + angleDiff(std::atan2(p.y, p.x), expected);
    moved[i].range = std::hypot(p.x, p.y);
  }

  LaserScan still = scan;
  still.time_increment_s = 0.0;
  const double direction = scan.angle_step_rad < 0.0 ? -1.0 : 1.0;
  std::size_t k = 0;  // moved[k], moved[k + 1] are the beams about the angle looked for
  for (std::size_t i = 0; i < n; ++i) {
    const double angle = scan.angle(i);
    while (k + 2 < n && direction * (moved[k + 1].angle - angle) < 0.0) ++k;
    const Polar& a = moved[k];
    const Polar& b = moved[k + 1];
    const double span = b.angle - a.angle;
    const double s = span == 0.0 ? 0.0 : (angle - a.angle) / span;
    const Polar& nearer = s < 0.5 ? a : b;
    float& range = still.ranges_m[i];
    range = std::numeric_limits<float>::quiet_NaN();
    // Beyond the ends of what was seen there is nothing.
    if (s < -1.0 || s > 2.0 || !nearer.valid) continue;
    const bool one_surface = a.valid && b.valid && s >= 0.0 && s <= 1.0 &&
                             std::abs(a.range - b.range) < kSameSurface * (a.range + b.range) / 2.0;
    range = static_cast<float>(one_surface ? (1.0 - s) * a.range + s * b.range : nearer.range);
  }
  return still;
}

}  // namespace vestibule::mapping
