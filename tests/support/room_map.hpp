#pragma once

#include <vector>

#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule {

/// A room in which no pose looks like another.
inline grid::OccupancyMap roomMap(double width_m, double height_m, const Pose2& T_map_grid = {}) {
  constexpr double kResolution = 0.05;
  const int width = static_cast<int>(width_m / kResolution);
  const int height = static_cast<int>(height_m / kResolution);
  std::vector<grid::Cell> cells;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool rim = x < 2 || y < 2 || x >= width - 2 || y >= height - 2;
      const bool inner_wall = x > width / 2 && x < width / 2 + 4 && y < height / 2;
      const bool cabinet = x > width / 5 && x < width / 3 && y > 3 * height / 4;
      cells.push_back(rim || inner_wall || cabinet ? grid::Cell::kOccupied : grid::Cell::kFree);
    }
  }
  return grid::OccupancyMap::fromCells(width, height, kResolution, {0, 0}, cells, T_map_grid);
}

}  // namespace vestibule
