#pragma once

#include <opencv2/core.hpp>

#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::sim {

/// The map as map_server stores it: one byte per cell, top row first.
inline cv::Mat mapPicture(const grid::OccupancyMap& map) {
  cv::Mat picture(map.height(), map.width(), CV_8UC1);
  for (int iy = 0; iy < map.height(); ++iy) {
    for (int ix = 0; ix < map.width(); ++ix) {
      const grid::Cell cell = map.cell(ix, iy);
      picture.at<std::uint8_t>(map.height() - 1 - iy, ix) = cell == grid::Cell::kOccupied ? 0
                                                            : cell == grid::Cell::kFree   ? 254
                                                                                          : 205;
    }
  }
  return picture;
}

/// Lower left corner of the picture in the map's own frame, as `origin` of a map_server YAML.
inline Pose2 mapOrigin(const grid::OccupancyMap& map, const Pose2& T_map_grid) {
  const Pose2 T_grid_cells = between(T_map_grid, map.T_map_grid());
  return compose(T_grid_cells, Pose2{map.corner().x, map.corner().y, 0.0});
}

}  // namespace vestibule::sim
