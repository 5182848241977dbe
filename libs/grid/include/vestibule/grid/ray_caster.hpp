#pragma once

#include <cstdint>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::grid {

/// Rays through a map, cell by cell (Amanatides & Woo 1987). Immutable.
class RayCaster {
 public:
  explicit RayCaster(const OccupancyMap& map);

  /// Distance from a point of the map frame to where the ray enters an occupied cell, at most
  /// `max_range_m`; 0 from within one. Unknown cells and what is outside do not stop it.
  [[nodiscard]] double range(const Point2& p_map, double yaw_rad, double max_range_m) const;

 private:
  [[nodiscard]] bool occupied(int ix, int iy) const {
    return ix >= 0 && iy >= 0 && ix < width_ && iy < height_ &&
           occupied_
                   [static_cast<std::size_t>(iy) * static_cast<std::size_t>(width_) +
                    static_cast<std::size_t>(ix)] != 0;
  }

  std::vector<std::uint8_t> occupied_;
  int width_;
  int height_;
  double resolution_m_;
  Pose2 T_cells_map_;
};

}  // namespace vestibule::grid
