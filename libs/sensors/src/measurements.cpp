#include "vestibule/sensors/measurements.hpp"

#include <cmath>

namespace vestibule {

std::string_view toString(GnssFixType type) {
  switch (type) {
    case GnssFixType::kNone:
      return "none";
    case GnssFixType::kUnknown:
      return "unknown";
    case GnssFixType::kSingle:
      return "single";
    case GnssFixType::kDifferential:
      return "differential";
    case GnssFixType::kRtkFloat:
      return "rtk_float";
    case GnssFixType::kRtkFixed:
      return "rtk_fixed";
  }
  return "?";
}

Timestamp stampOf(const Measurement& measurement) {
  return std::visit([](const auto& m) { return m.stamp; }, measurement);
}

std::vector<Point2> endPointsInBase(const LaserScan& scan) {
  std::vector<Point2> points;
  points.reserve(scan.ranges_m.size());
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    if (!scan.valid(i)) continue;
    const auto range = static_cast<double>(scan.ranges_m[i]);
    const double angle = scan.angle(i);
    points.push_back(
        transform(scan.T_base_laser, {range * std::cos(angle), range * std::sin(angle)}));
  }
  return points;
}

}  // namespace vestibule
