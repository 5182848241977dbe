#pragma once

#include <optional>
#include <vector>

#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::grid {

/// Exact Euclidean distance to the nearest occupied cell centre, per cell [m] (OpenCV's
/// distanceTransform with DIST_MASK_PRECISE: Felzenszwalb & Huttenlocher 2012).
class DistanceField {
 public:
  explicit DistanceField(const OccupancyMap& map);

  /// A rectangle of cells, the last ones included.
  struct CellBox {
    int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  };
  /// Brings the field up to date after cells of the box have changed: exactly what a new field
  /// would be, at the cost of the part of the map that the change reaches.
  /// \pre map has the size and place of the one the field was made for
  void update(const OccupancyMap& map, const CellBox& changed);

  /// Distance at a point of the map frame [m]; `outside` beyond the grid or without any obstacle.
  [[nodiscard]] double at(const Point2& p_map, double outside_m) const;

  [[nodiscard]] const Pose2& T_grid_map() const { return T_grid_map_; }
  /// The same at a point of the *grid* frame.
  [[nodiscard]] double atGrid(const Point2& p_grid, double outside_m) const;

  /// Way [m] from a point towards another until the first obstacle, or to `beyond_m` behind that
  /// other point when there is none before. Grid frame.
  [[nodiscard]] double firstObstacle(
      const Point2& from, const Point2& towards, double beyond_m) const;

  /// Distance between the centres of the four nearest cells, with its slope.
  struct Slope {
    double distance_m = 0.0;
    double gradient_x = 0.0;  ///< [m/m], grid axes
    double gradient_y = 0.0;
  };
  /// Bilinear distance at a point of the *grid* frame; empty beyond the outermost cell centres or
  /// without any obstacle.
  [[nodiscard]] std::optional<Slope> slopeAtGrid(const Point2& p_grid) const {
    const double fx = (p_grid.x - p_grid_corner_.x) / resolution_m_ - 0.5;
    const double fy = (p_grid.y - p_grid_corner_.y) / resolution_m_ - 0.5;
    if (distance_m_.empty() || !(fx >= 0.0 && fy >= 0.0 && fx < width_ - 1 && fy < height_ - 1)) {
      return std::nullopt;
    }
    const auto ix = static_cast<std::size_t>(fx);
    const auto iy = static_cast<std::size_t>(fy);
    const double u = fx - static_cast<double>(ix);
    const double v = fy - static_cast<double>(iy);
    const float* row = distance_m_.data() + iy * static_cast<std::size_t>(width_) + ix;
    const double d00 = static_cast<double>(row[0]);
    const double d10 = static_cast<double>(row[1]);
    const double d01 = static_cast<double>(row[width_]);
    const double d11 = static_cast<double>(row[width_ + 1]);
    const double low = d00 + u * (d10 - d00);
    const double high = d01 + u * (d11 - d01);
    return Slope{
        low + v * (high - low),
        ((d10 - d00) * (1.0 - v) + (d11 - d01) * v) / resolution_m_,
        (high - low) / resolution_m_};
  }

  /// Distances [m] row-major from the bottom left cell; empty when the map has no obstacle.
  [[nodiscard]] const std::vector<float>& cells() const { return distance_m_; }

 private:
  void rebuild(const OccupancyMap& map);
  /// Tries with a window this much larger than the box; false when the change reaches beyond it.
  bool updateWithin(const OccupancyMap& map, const CellBox& changed, int reach);

  std::vector<float> distance_m_;
  int width_;
  int height_;
  double resolution_m_;
  Point2 p_grid_corner_;
  Pose2 T_grid_map_;
};

}  // namespace vestibule::grid
