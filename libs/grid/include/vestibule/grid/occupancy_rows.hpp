#pragma once

#include <functional>

#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::grid {

/// As OccupancyMap::fromCells, row by row: `fill` writes the cells of row iy, width of them. A map
/// that is mostly unknown need not be there twice.
[[nodiscard]] OccupancyMap occupancyMapFromRows(
    int width,
    int height,
    double resolution_m,
    const Point2& p_grid_corner,
    const std::function<void(int iy, Cell* row)>& fill,
    const Pose2& T_map_grid = {});

}  // namespace vestibule::grid
