#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"

namespace mrpt::maps {
class COccupancyGridMap2D;
}

namespace vestibule::grid {

enum class Cell : std::uint8_t { kFree, kOccupied, kUnknown };

/// Where a map lies: what is known of it without its cells.
struct MapRectangle {
  Pose2 T_map_corner;  ///< of the lower left corner, axes along the map's own
  double width_m = 0.0;
  double height_m = 0.0;
  /// How far outside a point of the map frame lies [m]; 0 inside.
  [[nodiscard]] double outside(const Point2& p_map) const;
  [[nodiscard]] double fromCentre(const Point2& p_map) const;
};

/// A prebuilt occupancy map. Cells live in an MRPT grid whose axes are those of the image (x along
/// columns, y up); `T_map_grid` places that grid in the map frame (identity unless the map_server
/// origin has a yaw or a site georeferences it). Immutable once built; share the pointer freely.
class OccupancyMap {
 public:
  OccupancyMap(std::shared_ptr<mrpt::maps::COccupancyGridMap2D> grid, const Pose2& T_map_grid);

  /// \param cells row-major from the bottom left corner, width * height of them
  /// \param p_grid_corner lower left corner of the first cell [m]
  static OccupancyMap fromCells(
      int width,
      int height,
      double resolution_m,
      const Point2& p_grid_corner,
      const std::vector<Cell>& cells,
      const Pose2& T_map_grid = {});

  [[nodiscard]] const std::shared_ptr<mrpt::maps::COccupancyGridMap2D>& mrptGrid() const {
    return grid_;
  }
  [[nodiscard]] const Pose2& T_map_grid() const { return T_map_grid_; }
  /// The same cells under another georeference: T_new_grid = T_new_map + T_map_grid.
  [[nodiscard]] OccupancyMap movedBy(const Pose2& T_new_map) const;

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] double resolution() const { return resolution_m_; }
  /// Lower left corner of the grid, in grid coordinates [m].
  [[nodiscard]] const Point2& corner() const { return p_grid_corner_; }
  [[nodiscard]] MapRectangle rectangle() const;
  /// Cell at column ix (from the left), row iy (from the bottom).
  [[nodiscard]] Cell cell(int ix, int iy) const;
  /// Writes 0 for each occupied cell of a row and 1 for the others, width() of them.
  /// \return whether any cell is occupied
  bool markFree(int iy, std::uint8_t* row) const;
  /// Cell under a point of the map frame; unknown outside the grid.
  [[nodiscard]] Cell at(const Point2& p_map) const;
  /// Cell under a point of the *grid* frame; unknown outside the grid.
  [[nodiscard]] Cell atGrid(const Point2& p_grid) const;
  [[nodiscard]] std::size_t count(Cell kind) const;

 private:
  std::shared_ptr<mrpt::maps::COccupancyGridMap2D> grid_;
  Pose2 T_map_grid_;
  int width_ = 0;
  int height_ = 0;
  double resolution_m_ = 0.0;
  Point2 p_grid_corner_;
};

}  // namespace vestibule::grid
