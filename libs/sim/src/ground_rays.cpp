#include "vestibule/sim/ground_rays.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vestibule::sim {
namespace {

constexpr double kLeaf_m = 0.5;
constexpr int kMostLeavesPerSide = 2048;  // a larger terrain gets larger leaves
constexpr double kStep_m = 0.1;           // within leaves that are not level
constexpr int kHalvings = 12;
constexpr double kNever = std::numeric_limits<double>::infinity();

std::vector<Point2> cornersOf(const HeightField& field) {
  const double x = field.columns * field.resolution_m;
  const double y = field.rows * field.resolution_m;
  std::vector<Point2> corners;
  for (const Point2& p : {Point2{0, 0}, Point2{x, 0}, Point2{x, y}, Point2{0, y}}) {
    corners.push_back(transform(field.T_map_image, p));
  }
  return corners;
}

geo::Polygon outlineOf(const Ramp& ramp) {
  const double dx = ramp.to.x - ramp.from.x;
  const double dy = ramp.to.y - ramp.from.y;
  const double half = 0.5 * ramp.width_m / std::hypot(dx, dy);
  const Point2 side{-half * dy, half * dx};
  return {ramp.from - side, ramp.to - side, ramp.to + side, ramp.from + side};
}

double alongRamp(const Ramp& ramp, const Point2& p) {
  const double dx = ramp.to.x - ramp.from.x;
  const double dy = ramp.to.y - ramp.from.y;
  return ((p.x - ramp.from.x) * dx + (p.y - ramp.from.y) * dy) / (dx * dx + dy * dy);
}

}  // namespace

/// A ray with its horizontal place as seen from the corner of the extent.
struct GroundRays::Ray {
  Eigen::Vector3d origin;
  Eigen::Vector3d direction;
  [[nodiscard]] double height(double range) const { return origin.z() + range * direction.z(); }
};

GroundRays::GroundRays(const Terrain& terrain) : terrain_(terrain) {
  if (terrain.flat()) return;
  std::vector<Point2> points;
  const auto take = [&points](const std::vector<Point2>& more) {
    points.insert(points.end(), more.begin(), more.end());
  };
  for (const HeightField& field : terrain.fields) take(cornersOf(field));
  for (const Plate& plate : terrain.plates) take(plate.outline);
  for (const Ramp& ramp : terrain.ramps) take(outlineOf(ramp));
  Point2 low = points.front();
  Point2 high = low;
  for (const Point2& p : points) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
  const double extent_m = std::max(high.x - low.x, high.y - low.y);
  leaf_m_ = std::max(kLeaf_m, extent_m / kMostLeavesPerSide);
  p_corner_ = {low.x - 0.5 * leaf_m_, low.y - 0.5 * leaf_m_};
  Level leaves;
  leaves.columns = static_cast<int>((high.x - p_corner_.x) / leaf_m_) + 2;
  leaves.rows = static_cast<int>((high.y - p_corner_.y) / leaf_m_) + 2;
  for (int row = 0; row < leaves.rows; ++row) {
    for (int column = 0; column < leaves.columns; ++column) {
      leaves.spans.push_back(leafSpan(column, row));
    }
  }
  levels_.push_back(std::move(leaves));
  while (levels_.back().columns > 1 || levels_.back().rows > 1) {
    const Level& fine = levels_.back();
    Level coarse;
    coarse.columns = (fine.columns + 1) / 2;
    coarse.rows = (fine.rows + 1) / 2;
    coarse.spans.assign(
        static_cast<std::size_t>(coarse.columns) * static_cast<std::size_t>(coarse.rows),
        {std::numeric_limits<float>::max(), std::numeric_limits<float>::lowest()});
    for (int row = 0; row < fine.rows; ++row) {
      for (int column = 0; column < fine.columns; ++column) {
        const Span& from = fine.spans[static_cast<std::size_t>(row * fine.columns + column)];
        Span& to = coarse.spans[static_cast<std::size_t>(row / 2 * coarse.columns + column / 2)];
        to.low_m = std::min(to.low_m, from.low_m);
        to.high_m = std::max(to.high_m, from.high_m);
      }
    }
    levels_.push_back(std::move(coarse));
  }
}

GroundRays::Span GroundRays::leafSpan(int column, int row) const {
  const Point2 low{p_corner_.x + column * leaf_m_, p_corner_.y + row * leaf_m_};
  const Point2 high{low.x + leaf_m_, low.y + leaf_m_};
  const std::vector<Point2> corners{low, {high.x, low.y}, high, {low.x, high.y}};
  const Point2 centre{0.5 * (low.x + high.x), 0.5 * (low.y + high.y)};
  const double reach_m = 0.5 * std::sqrt(2.0) * leaf_m_;
  double lowest = 0.0;
  double highest = 0.0;
  // What lies on top replaces what is below where it covers the leaf, and widens the span where it
  // may touch it.
  const auto cover = [&](const geo::Polygon& outline, double from_m, double to_m) {
    const double distance_m = geo::signedDistance(outline, centre);
    if (distance_m > reach_m) return;
    const bool all = distance_m < -reach_m;
    lowest = all ? from_m : std::min(lowest, from_m);
    highest = all ? to_m : std::max(highest, to_m);
  };
  for (const HeightField& field : terrain_.fields) {
    // Every height that the interpolation can use within the leaf.
    double x0 = kNever, y0 = kNever, x1 = -kNever, y1 = -kNever;
    for (const Point2& corner : corners) {
      const Point2 p = transform(inverse(field.T_map_image), corner);
      x0 = std::min(x0, p.x / field.resolution_m);
      x1 = std::max(x1, p.x / field.resolution_m);
      y0 = std::min(y0, p.y / field.resolution_m);
      y1 = std::max(y1, p.y / field.resolution_m);
    }
    if (x1 < 0.0 || y1 < 0.0 || x0 > field.columns || y0 > field.rows) continue;
    const auto first = [](double v, int count) {
      return std::clamp(static_cast<int>(std::floor(v - 0.5)), 0, count - 1);
    };
    const auto last = [](double v, int count) {
      return std::clamp(static_cast<int>(std::floor(v - 0.5)) + 1, 0, count - 1);
    };
    double from_m = kNever;
    double to_m = -kNever;
    for (int iy = first(y0, field.rows); iy <= last(y1, field.rows); ++iy) {
      for (int ix = first(x0, field.columns); ix <= last(x1, field.columns); ++ix) {
        const double h = static_cast<double>(
            field.heights_m
                [static_cast<std::size_t>(iy) * static_cast<std::size_t>(field.columns) +
                 static_cast<std::size_t>(ix)]);
        from_m = std::min(from_m, h);
        to_m = std::max(to_m, h);
      }
    }
    cover(cornersOf(field), from_m, to_m);
  }
  for (const Plate& plate : terrain_.plates) cover(plate.outline, plate.height_m, plate.height_m);
  for (const Ramp& ramp : terrain_.ramps) {
    double from_m = kNever;
    double to_m = -kNever;
    for (const Point2& corner : corners) {
      const double h = ramp.start_m + std::clamp(alongRamp(ramp, corner), 0.0, 1.0) * ramp.rise_m;
      from_m = std::min(from_m, h);
      to_m = std::max(to_m, h);
    }
    cover(outlineOf(ramp), from_m, to_m);
  }
  // Rounding to float must not narrow the span; a level leaf keeps one height.
  if (lowest == highest) {
    const auto level = static_cast<float>(lowest);
    return {level, level};
  }
  constexpr double kRounding_m = 1e-4;
  return {static_cast<float>(lowest - kRounding_m), static_cast<float>(highest + kRounding_m)};
}

double GroundRays::range(
    const Eigen::Vector3d& p_map_origin,
    const Eigen::Vector3d& direction_map,
    double max_range_m) const {
  const Ray ray{p_map_origin, direction_map};
  const auto on_zero = [&ray](double from_m, double to_m) {
    if (!(from_m < to_m)) return kNever;
    if (ray.height(from_m) <= 0.0) return from_m;
    if (ray.direction.z() >= 0.0) return kNever;
    const double range = -ray.origin.z() / ray.direction.z();
    return range < to_m ? range : kNever;
  };
  // Where the ray is above the extent (slab method).
  double enter_m = 0.0;
  double leave_m = levels_.empty() ? -1.0 : max_range_m;
  const auto slab = [&](double offset, double d, double size) {
    if (d == 0.0) {
      if (offset < 0.0 || offset > size) leave_m = -1.0;
      return;
    }
    enter_m = std::max(enter_m, std::min(-offset / d, (size - offset) / d));
    leave_m = std::min(leave_m, std::max(-offset / d, (size - offset) / d));
  };
  if (!levels_.empty()) {
    slab(ray.origin.x() - p_corner_.x, ray.direction.x(), levels_.front().columns * leaf_m_);
    slab(ray.origin.y() - p_corner_.y, ray.direction.y(), levels_.front().rows * leaf_m_);
  }
  if (leave_m < enter_m) return std::min(on_zero(0.0, max_range_m), max_range_m);
  double range = on_zero(0.0, enter_m);
  if (range == kNever) range = withinExtent(ray, enter_m, leave_m);
  if (range == kNever) range = on_zero(leave_m, max_range_m);
  return std::min(range, max_range_m);
}

double GroundRays::withinExtent(const Ray& ray, double from_m, double to_m) const {
  constexpr double kNudge_m = 1e-9;  // over the border of a cell
  std::size_t level = levels_.size() - 1;
  double here_m = from_m;
  while (here_m < to_m) {
    const Level& cells = levels_[level];
    const double size_m = std::ldexp(leaf_m_, static_cast<int>(level));
    const auto step = [&](double offset, double d, int count, int& index) {
      const double place = (offset + (here_m + kNudge_m) * d) / size_m;
      index = std::clamp(static_cast<int>(std::floor(place)), 0, count - 1);
      if (d == 0.0) return kNever;
      return ((index + (d > 0.0 ? 1 : 0)) * size_m - offset) / d;
    };
    int column = 0;
    int row = 0;
    const double next_x =
        step(ray.origin.x() - p_corner_.x, ray.direction.x(), cells.columns, column);
    const double next_y = step(ray.origin.y() - p_corner_.y, ray.direction.y(), cells.rows, row);
    const double exit_m = std::min({std::max(std::min(next_x, next_y), here_m + kNudge_m), to_m});
    const Span& span = cells.spans[static_cast<std::size_t>(row * cells.columns + column)];
    const double lowest_m = std::min(ray.height(here_m), ray.height(exit_m));
    if (lowest_m <= static_cast<double>(span.high_m)) {
      if (level > 0) {
        --level;
        continue;
      }
      const double range = withinLeaf(ray, span, here_m, exit_m);
      if (range != kNever) return range;
    } else if (level + 1 < levels_.size()) {
      ++level;
    }
    here_m = exit_m;
  }
  return kNever;
}

double GroundRays::withinLeaf(const Ray& ray, const Span& span, double from_m, double to_m) const {
  if (span.low_m == span.high_m) {
    const auto height_m = static_cast<double>(span.high_m);
    if (ray.height(from_m) <= height_m) return from_m;
    if (ray.height(to_m) > height_m) return kNever;
    return std::min((height_m - ray.origin.z()) / ray.direction.z(), to_m);
  }
  const auto above = [&](double range) {
    const Eigen::Vector3d p = ray.origin + range * ray.direction;
    return p.z() > terrain_.height({p.x(), p.y()});
  };
  if (!above(from_m)) return from_m;
  for (double low = from_m; low < to_m; low += kStep_m) {
    double high = std::min(low + kStep_m, to_m);
    if (above(high)) continue;
    double clear = low;
    for (int i = 0; i < kHalvings; ++i) {
      const double middle = 0.5 * (clear + high);
      (above(middle) ? clear : high) = middle;
    }
    return high;
  }
  return kNever;
}

}  // namespace vestibule::sim
