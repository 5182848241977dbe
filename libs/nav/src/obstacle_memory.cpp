#include "vestibule/nav/obstacle_memory.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule::nav {
namespace {

constexpr std::size_t kSectors = 120;  // 3 degrees
/// A point must be seen this often to be remembered.
constexpr int kConfirmingScans = 3;
constexpr int kNeighbourBeams = 2;
constexpr double kSamePlace_m = 0.2;

std::size_t sectorOf(const Point2& p, const Point2& eye) {
  const double turn = (std::atan2(p.y - eye.y, p.x - eye.x) + kPi) / (2.0 * kPi);
  return std::min(kSectors - 1, static_cast<std::size_t>(turn * kSectors));
}

}  // namespace

void describe(ParamIo& io, ObstacleMemoryParams& params) {
  io.optional("radius_m", params.radius_m, positive());
  io.optional("max_age_s", params.max_age_s, nonNegative());
  io.optional("spacing_m", params.spacing_m, positive());
}

ObstacleMemory::ObstacleMemory(const ObstacleMemoryParams& params, const Footprint& footprint)
    : params_(params), footprint_(footprint) {}

std::vector<Point2> ObstacleMemory::withoutStrays(
    const Pose2& T_odom_base, const std::vector<Point2>& scan_base, const Point2& p_base_laser) {
  std::vector<Point2> scan_odom;
  for (const Point2& p : scan_base) scan_odom.push_back(transform(T_odom_base, p));

  const auto hasNeighbour = [&](std::size_t i) {
    const Point2& p = scan_base[i];
    const double range_m = std::hypot(p.x - p_base_laser.x, p.y - p_base_laser.y);
    // Beams part with range, and on a slanting wall their ends do more so.
    const double near_m = 0.1 + 0.05 * range_m;
    for (int offset = -kNeighbourBeams; offset <= kNeighbourBeams; ++offset) {
      const std::ptrdiff_t j = static_cast<std::ptrdiff_t>(i) + offset;
      if (offset == 0 || j < 0 || j >= static_cast<std::ptrdiff_t>(scan_base.size())) continue;
      const Point2& q = scan_base[static_cast<std::size_t>(j)];
      if (std::hypot(p.x - q.x, p.y - q.y) < near_m) return true;
    }
    return false;
  };
  const auto wasThere = [&](const Point2& p_odom) {
    return std::any_of(
        previous_scan_odom_.begin(), previous_scan_odom_.end(), [&](const Point2& q) {
          return std::hypot(p_odom.x - q.x, p_odom.y - q.y) < kSamePlace_m;
        });
  };

  std::vector<Point2> kept;
  for (std::size_t i = 0; i < scan_base.size(); ++i) {
    if (!has_previous_ || hasNeighbour(i) || wasThere(scan_odom[i])) kept.push_back(scan_base[i]);
  }
  previous_scan_odom_ = std::move(scan_odom);
  has_previous_ = true;
  return kept;
}

std::vector<Point2> ObstacleMemory::update(
    Timestamp stamp,
    const Pose2& T_odom_base,
    const std::vector<Point2>& raw_scan_base,
    const Point2& p_base_laser) {
  const std::vector<Point2> scan_base = withoutStrays(T_odom_base, raw_scan_base, p_base_laser);
  std::array<bool, kSectors> looked_at{};
  std::vector<Point2> near;  // of the scan, thinned out
  for (const Point2& p : scan_base) {
    looked_at[sectorOf(p, p_base_laser)] = true;
    if (std::hypot(p.x, p.y) > params_.radius_m || footprint_.signedDistance(p) <= 0.0) continue;
    const bool is_new = std::none_of(near.begin(), near.end(), [&](const Point2& q) {
      return std::hypot(p.x - q.x, p.y - q.y) < params_.spacing_m;
    });
    if (is_new) near.push_back(p);
  }

  const Pose2 T_base_odom = inverse(T_odom_base);
  std::vector<Point2> all = scan_base;
  std::vector<Remembered> kept;
  std::vector<int> seen_before(near.size(), 0);
  for (const Remembered& old : points_) {
    const Point2 p = transform(T_base_odom, old.p_odom);
    if (std::hypot(p.x, p.y) > params_.radius_m || footprint_.signedDistance(p) <= 0.0) continue;
    // Twice the spacing: noise moves both points.
    const double same_m = 2.0 * params_.spacing_m;
    bool seen_now = false;
    for (std::size_t i = 0; i < near.size(); ++i) {
      if (std::hypot(p.x - near[i].x, p.y - near[i].y) > same_m) continue;
      seen_before[i] = std::max(seen_before[i], old.scans);
      seen_now = true;
    }
    if (seen_now || looked_at[sectorOf(p, p_base_laser)] || old.scans < kConfirmingScans) continue;
    if (toSeconds(stamp - old.seen) > params_.max_age_s) continue;
    kept.push_back(old);
    all.push_back(p);
  }
  for (std::size_t i = 0; i < near.size(); ++i) {
    kept.push_back({transform(T_odom_base, near[i]), stamp, seen_before[i] + 1});
  }
  points_ = std::move(kept);
  return all;
}

}  // namespace vestibule::nav
