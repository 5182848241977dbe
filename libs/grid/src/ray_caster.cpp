#include "vestibule/grid/ray_caster.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vestibule::grid {
namespace {

/// One axis of the walk, in cells.
struct Axis {
  int cell;
  int step;
  double next;   // ray parameter at the next cell border
  double delta;  // between two borders

  Axis(double start, double direction)
      : cell(static_cast<int>(std::floor(start))), step(direction > 0.0 ? 1 : -1) {
    constexpr double kNever = std::numeric_limits<double>::infinity();
    delta = direction == 0.0 ? kNever : 1.0 / std::abs(direction);
    const double to_border = direction > 0.0 ? cell + 1.0 - start : start - cell;
    next = direction == 0.0 ? kNever : to_border * delta;
  }
  double advance() {
    cell += step;
    next += delta;
    return next - delta;
  }
};

/// The part of a ray over [0, size] on one axis, as ray parameters; empty when first > last.
struct Span {
  double first = 0.0;
  double last = std::numeric_limits<double>::infinity();

  void cut(double start, double direction, double size) {
    if (direction == 0.0) {
      if (!(start >= 0.0 && start <= size)) last = -1.0;
      return;
    }
    const double a = -start / direction;
    const double b = (size - start) / direction;
    first = std::max(first, std::min(a, b));
    last = std::min(last, std::max(a, b));
  }
};

}  // namespace

RayCaster::RayCaster(const OccupancyMap& map)
    : width_(map.width()),
      height_(map.height()),
      resolution_m_(map.resolution()),
      T_cells_map_(inverse(compose(map.T_map_grid(), Pose2{map.corner().x, map.corner().y, 0.0}))) {
  occupied_.reserve(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  for (int iy = 0; iy < height_; ++iy) {
    for (int ix = 0; ix < width_; ++ix) {
      occupied_.push_back(map.cell(ix, iy) == Cell::kOccupied ? 1 : 0);
    }
  }
}

double RayCaster::range(const Point2& p_map, double yaw_rad, double max_range_m) const {
  const Point2 p = transform(T_cells_map_, p_map);
  const double yaw = yaw_rad + T_cells_map_.phi;
  const Point2 start{p.x / resolution_m_, p.y / resolution_m_};
  const Point2 direction{std::cos(yaw), std::sin(yaw)};
  if (!std::isfinite(start.x + start.y + yaw)) return max_range_m;
  // Nothing is mapped beyond the map: no walk there, however far it is.
  Span over_map;
  over_map.cut(start.x, direction.x, width_);
  over_map.cut(start.y, direction.y, height_);
  const double max_cells = std::min(max_range_m / resolution_m_, over_map.last + 2.0);
  if (!(over_map.first <= over_map.last && over_map.first < max_cells)) return max_range_m;
  Axis x(start.x, direction.x);
  Axis y(start.y, direction.y);
  double walked = 0.0;
  while (!occupied(x.cell, y.cell)) {
    walked = x.next < y.next ? x.advance() : y.advance();
    if (!(walked < max_cells)) return max_range_m;
  }
  return walked * resolution_m_;
}

}  // namespace vestibule::grid
