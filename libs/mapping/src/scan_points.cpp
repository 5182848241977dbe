#include "vestibule/mapping/scan_points.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::mapping {
namespace {

constexpr double kReachQuantile = 0.8;
constexpr std::size_t kMinNeighbours = 4;  // with the point itself, for a line
constexpr double kMinRadius_m = 0.20;      // of the neighbourhood
constexpr double kRadiusInSpacings = 3.5;  // the same where beams are far apart
constexpr double kMaxRadius_m = 0.60;
constexpr double kMaxThickness_m = 0.03;  // one sigma across a line
constexpr double kMinElongation = 3.0;    // of sigma along to sigma across
constexpr double kAlone_m = 0.5;          // in front of its neighbours, a thing of its own

/// Makes the point one of a wall if the end points first..last lie on a line.
bool onLine(
    const std::vector<Point2>& ends, std::size_t first, std::size_t last, ScanPoint& point) {
  double mx = 0.0;
  double my = 0.0;
  const auto count = static_cast<double>(last - first + 1);
  for (std::size_t j = first; j <= last; ++j) {
    mx += ends[j].x / count;
    my += ends[j].y / count;
  }
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
  if (across > kMaxThickness_m || along < kMinElongation * across) return false;
  const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy) + kPi / 2.0;
  point.nx = std::cos(angle);
  point.ny = std::sin(angle);
  point.surface = Surface::kWall;
  return true;
}

/// Says what end point number i lies on, from those around it.
void classify(const std::vector<Point2>& ends, std::size_t i, double spacing_m, ScanPoint& point) {
  const double radius = std::clamp(kRadiusInSpacings * spacing_m, kMinRadius_m, kMaxRadius_m);
  const auto gap = [&](std::size_t j) {
    return std::hypot(ends[j].x - ends[i].x, ends[j].y - ends[i].y);
  };
  std::size_t first = i;
  std::size_t last = i;
  while (first > 0 && gap(first - 1) <= radius) --first;
  while (last + 1 < ends.size() && gap(last + 1) <= radius) ++last;
  if (last - first + 1 >= kMinNeighbours) {
    if (!onLine(ends, first, last, point)) point.surface = Surface::kSpot;
    return;
  }
  // Beams that graze a wall far away end far apart, but on a line. What stands alone before or
  // behind its neighbours is a thing of its own; anything else says nothing about the way along.
  if (i >= 2 && i + 2 < ends.size() && onLine(ends, i - 2, i + 2, point)) return;
  const auto range = [&](std::size_t j) { return std::hypot(ends[j].x, ends[j].y); };
  const bool before = first == 0 || std::abs(range(first - 1) - range(i)) > kAlone_m;
  const bool after = last + 1 == ends.size() || std::abs(range(last + 1) - range(i)) > kAlone_m;
  const bool nearer = (first == 0 || range(first - 1) > range(i)) &&
                      (last + 1 == ends.size() || range(last + 1) > range(i));
  if (before && after && nearer) point.surface = Surface::kSpot;
}

}  // namespace

ScanPoints matchPoints(const LaserScan& scan, const MatcherParams& params) {
  std::vector<Point2> ends;
  std::vector<double> ranges;
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const auto range = static_cast<double>(scan.ranges_m[i]);
    if (!scan.valid(i) || range > params.max_range_m) continue;
    ends.push_back(transform(
        scan.T_base_laser, {range * std::cos(scan.angle(i)), range * std::sin(scan.angle(i))}));
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
    classify(ends, i, ranges[i] * std::abs(scan.angle_step_rad), point);
    result.points.push_back(point);
    reach.push_back(std::hypot(point.x, point.y));
  }
  const auto rank = static_cast<std::ptrdiff_t>(kReachQuantile * static_cast<double>(n - 1));
  std::nth_element(reach.begin(), reach.begin() + rank, reach.end());
  result.reach_m = reach[static_cast<std::size_t>(rank)];
  return result;
}

}  // namespace vestibule::mapping
