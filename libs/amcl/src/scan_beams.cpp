#include "scan_beams.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::amcl {

std::vector<Point2> beamEnds(
    const LaserScan& scan, double max_range_m, const Eigen::Vector3d& twist_base) {
  const Pose2& L = scan.T_base_laser;
  std::vector<Point2> ends;
  ends.reserve(scan.ranges_m.size());
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const auto range = static_cast<double>(scan.ranges_m[i]);
    if (!scan.valid(i) || range > max_range_m) continue;
    const double angle = L.phi + scan.angle(i);
    Point2 end{L.x + range * std::cos(angle), L.y + range * std::sin(angle)};
    if (scan.time_increment_s != 0.0) {
      const double t_s = static_cast<double>(i) * scan.time_increment_s;
      end = transform(expSe2(twist_base * t_s), end);
    }
    ends.push_back(end);
  }
  return ends;
}

std::vector<Point2> spreadAlongContour(
    const std::vector<Point2>& ends, double min_spacing_m, int max_beams) {
  std::vector<Point2> spaced;
  Point2 last{1e9, 1e9};
  for (const Point2& end : ends) {
    if (std::hypot(end.x - last.x, end.y - last.y) < min_spacing_m) continue;
    spaced.push_back(end);
    last = end;
  }
  const std::size_t n = std::min(spaced.size(), static_cast<std::size_t>(max_beams));
  std::vector<Point2> chosen;
  chosen.reserve(n);
  for (std::size_t k = 0; k < n; ++k) chosen.push_back(spaced[k * spaced.size() / n]);
  return chosen;
}

}  // namespace vestibule::amcl
