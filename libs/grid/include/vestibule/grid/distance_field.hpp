#pragma once

#include <vector>

#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::grid {

/// Exact Euclidean distance to the nearest occupied cell centre, per cell [m] (OpenCV's
/// distanceTransform with DIST_MASK_PRECISE: Felzenszwalb & Huttenlocher 2012). Immutable.
class DistanceField {
 public:
  explicit DistanceField(const OccupancyMap& map);

  /// Distance at a point of the map frame [m]; `outside` beyond the grid or without any obstacle.
  [[nodiscard]] double at(const Point2& p_map, double outside_m) const;

  /// Distances [m] row-major from the bottom left cell; empty when the map has no obstacle.
  [[nodiscard]] const std::vector<float>& cells() const { return distance_m_; }

 private:
  std::vector<float> distance_m_;
  int width_;
  int height_;
  double resolution_m_;
  Point2 p_grid_corner_;
  Pose2 T_grid_map_;
};

}  // namespace vestibule::grid
