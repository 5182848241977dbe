#include "vestibule/mapping/scan_points.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::mapping {
namespace {

constexpr double kReachQuantile = 0.8;
constexpr std::size_t kMinNeighbours = 4;    // with the point itself, for a line
constexpr double kMinRadius_m = 0.20;        // of the neighbourhood
constexpr double kRadiusInSpacings = 3.5;    // the same where beams are far apart
constexpr double kMaxRadius_m = 0.60;
constexpr double kMaxThickness_m = 0.03;     // one sigma across a line
constexpr double kMinElongation = 3.0;       // of sigma along to sigma across

/// Fits a line to the end points around number i and writes its normal.
void fitLine(
    const std::vector<Point2>& ends, std::size_t i, double spacing_m, ScanPoint& point) {
  const double radius =
      std::clamp(kRadiusInSpacings * spacing_m, kMinRadius_m, kMaxRadius_m);
  const auto near = [&](std::size_t j) {
    return std::hypot(ends[j].x - ends[i].x, ends[j].y - ends[i].y) <= radius;
  };
  std::size_t first = i;
  std::size_t last = i;
  while (first > 0 && near(first - 1)) --first;
  while (last + 1 < ends.size() && near(last + 1)) ++last;
  const std::size_t n = last - first + 1;
  if (n < kMinNeighbours) return;
  double mx = 0.0;
  double my = 0.0;
  for (std::size_t j = first; j <= last; ++j) {
    mx += ends[j].x;
    my += ends[j].y;
  }
  const auto count = static_cast<double>(n);
  mx /= count;
  my /= count;
  double xx = 0.0;
  double xy = 0.0;
  double yy = 0.0;
  for (std::size_t j = first; j <= last; ++j) {
    const double dx = ends[j].x - mx;
    const double dy = ends[j].y - my;
    xx += dx * dx;
    xy += dx * dy;
    yy += dy * dy;
  }
  const double mean = 0.5 * (xx + yy);
  const double half = std::hypot(0.5 * (xx - yy), xy);
  const double across = std::sqrt(std::max(mean - half, 0.0) / count);
  const double along = std::sqrt((mean + half) / count);
  if (across > kMaxThickness_m || along < kMinElongation * across) return;
  const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy) + kPi / 2.0;
  point.nx = std::cos(angle);
  point.ny = std::sin(angle);
  point.on_line = true;
}

}  // namespace

ScanPoints matchPoints(const LaserScan& scan, const MatcherParams& params) {
  std::vector<Point2> ends;
  std::vector<double> ranges;
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const auto range = static_cast<double>(scan.ranges_m[i]);
    if (!scan.valid(i) || range > params.max_range_m) continue;
    ends.push_back(transform(
        scan.T_base_laser,
        {range * std::cos(scan.angle(i)), range * std::sin(scan.angle(i))}));
    ranges.push_back(range);
  }
  ScanPoints result;
  if (ends.empty()) return result;
  std::vector<std::size_t> spaced;
  Point2 last{1e9, 1e9};
  for (std::size_t i = 0; i < ends.size(); ++i) {
    if (std::hypot(ends[i].x - last.x, ends[i].y - last.y) < params.min_spacing_m) continue;
    spaced.push_back(i);
    last = ends[i];
  }
  const auto limit = static_cast<std::size_t>(params.max_beams);
  const std::size_t n = std::min(spaced.size(), limit);
  std::vector<double> reach;
  result.points.reserve(n);
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t i = spaced[k * spaced.size() / n];
    ScanPoint point;
    point.x = ends[i].x;
    point.y = ends[i].y;
    fitLine(ends, i, ranges[i] * std::abs(scan.angle_step_rad), point);
    result.points.push_back(point);
    reach.push_back(std::hypot(point.x, point.y));
  }
  const auto rank = static_cast<std::ptrdiff_t>(kReachQuantile * static_cast<double>(n - 1));
  std::nth_element(reach.begin(), reach.begin() + rank, reach.end());
  result.reach_m = reach[static_cast<std::size_t>(rank)];
  return result;
}

}  // namespace vestibule::mapping
