#include "relocate.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/grid/branch_and_bound.hpp"

namespace vestibule::mapping {
namespace {

constexpr double kCell_m = 0.1;
constexpr double kReach_m = 15.0;      // farther points are left out
constexpr double kMargin_m = 1.0;      // of the field around the points
constexpr double kSeparation_m = 0.6;  // of two places

std::vector<Point2> pointsOf(const Cluster& cluster, double reach_m) {
  std::vector<Point2> points;
  for (const Cluster::Member& m : cluster.members) {
    m.contour->forSamples([&](const ContourPoint& p) {
      if (p.range_m <= reach_m) points.push_back(transform(m.T_cluster_base, {p.x, p.y}));
    });
  }
  return points;
}

/// exp(-d^2 / 2 cell^2) of the distance to the nearest point.
grid::ScoreField fieldOf(const std::vector<Point2>& points) {
  Point2 low{1e9, 1e9};
  Point2 high{-1e9, -1e9};
  for (const Point2& p : points) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
  low = {low.x - kMargin_m, low.y - kMargin_m};
  const int width = static_cast<int>((high.x + kMargin_m - low.x) / kCell_m) + 1;
  const int height = static_cast<int>((high.y + kMargin_m - low.y) / kCell_m) + 1;
  std::vector<float> scores(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const double scale = -0.5 / (kCell_m * kCell_m);
  for (const Point2& p : points) {
    const int cx = static_cast<int>((p.x - low.x) / kCell_m);
    const int cy = static_cast<int>((p.y - low.y) / kCell_m);
    for (int iy = std::max(0, cy - 2); iy <= std::min(height - 1, cy + 2); ++iy) {
      for (int ix = std::max(0, cx - 2); ix <= std::min(width - 1, cx + 2); ++ix) {
        const double dx = low.x + (ix + 0.5) * kCell_m - p.x;
        const double dy = low.y + (iy + 0.5) * kCell_m - p.y;
        float& score = scores
            [static_cast<std::size_t>(iy) * static_cast<std::size_t>(width) +
             static_cast<std::size_t>(ix)];
        score = std::max(score, static_cast<float>(std::exp(scale * (dx * dx + dy * dy))));
      }
    }
  }
  return {width, height, kCell_m, Pose2{low.x, low.y, 0.0}, scores, kReach_m};
}

}  // namespace

std::vector<Place> PlaceFinder::find(
    const Cluster& b, const Pose2& guess, const SearchParams& params) {
  const std::vector<Point2> query = pointsOf(b, kReach_m);
  if (query.empty()) return {};
  if (!field_) {
    const std::vector<Point2> target = pointsOf(a_, 2.0 * kReach_m);
    if (target.empty()) return {};
    field_.emplace(fieldOf(target));
  }
  grid::BranchAndBoundParams search;
  search.min_score = params.min_score;
  search.relative_score = 0.8;
  search.max_matches = params.max_matches;
  search.separation_m = kSeparation_m;
  search.threads = 1;  // the callers search several pairs at once
  const grid::BranchAndBoundMatcher matcher(search);
  grid::SearchWindow window;
  window.T_map_centre = guess;
  window.half_x_m = params.half_m;
  window.half_y_m = params.half_m;
  window.half_yaw_rad = params.half_rad;
  std::vector<Place> places;
  for (const grid::PoseMatch& m : matcher.match(*field_, query, window)) {
    places.push_back({m.T_map_base, m.score});
  }
  return places;
}

}  // namespace vestibule::mapping
