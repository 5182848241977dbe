#include "vestibule/grid/occupancy_map.hpp"

#include <mrpt/maps/COccupancyGridMap2D.h>

#include <algorithm>
#include <cassert>
#include <cmath>

#include "vestibule/grid/occupancy_rows.hpp"

namespace vestibule::grid {
namespace {

// Occupancy probabilities stored for the three kinds of cell, and the limits that read them back.
constexpr float kFreeness[] = {0.98F, 0.02F, 0.5F};  // MRPT stores p(free); order as in Cell
constexpr float kOccupiedBelow = 0.35F;
constexpr float kFreeAbove = 0.6F;

}  // namespace

double MapRectangle::outside(const Point2& p_map) const {
  const Point2 p = transform(inverse(T_map_corner), p_map);
  return std::hypot(std::max({0.0, -p.x, p.x - width_m}), std::max({0.0, -p.y, p.y - height_m}));
}

double MapRectangle::fromCentre(const Point2& p_map) const {
  const Point2 centre = transform(T_map_corner, {0.5 * width_m, 0.5 * height_m});
  return std::hypot(centre.x - p_map.x, centre.y - p_map.y);
}

OccupancyMap::OccupancyMap(
    std::shared_ptr<mrpt::maps::COccupancyGridMap2D> grid, const Pose2& T_map_grid)
    : grid_(std::move(grid)),
      T_map_grid_(T_map_grid),
      width_(static_cast<int>(grid_->getSizeX())),
      height_(static_cast<int>(grid_->getSizeY())),
      resolution_m_(static_cast<double>(grid_->getResolution())),
      p_grid_corner_{static_cast<double>(grid_->getXMin()), static_cast<double>(grid_->getYMin())} {
}

OccupancyMap OccupancyMap::fromCells(
    int width,
    int height,
    double resolution_m,
    const Point2& p_grid_corner,
    const std::vector<Cell>& cells,
    const Pose2& T_map_grid) {
  assert(cells.size() == static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const auto fill = [&](int iy, Cell* row) {
    std::copy_n(cells.begin() + static_cast<std::ptrdiff_t>(iy) * width, width, row);
  };
  return occupancyMapFromRows(width, height, resolution_m, p_grid_corner, fill, T_map_grid);
}

OccupancyMap occupancyMapFromRows(
    int width,
    int height,
    double resolution_m,
    const Point2& p_grid_corner,
    const std::function<void(int iy, Cell* row)>& fill,
    const Pose2& T_map_grid) {
  auto grid = mrpt::maps::COccupancyGridMap2D::Create();
  // MRPT snaps grid limits to multiples of the resolution: the corner is carried by the pose, so
  // that no origin is rounded.
  const auto res = static_cast<float>(resolution_m);
  grid->setSize(
      0.0F, res * static_cast<float>(width), 0.0F, res * static_cast<float>(height), res, 0.5F);
  assert(grid->getSizeX() == static_cast<unsigned>(width));
  assert(grid->getSizeY() == static_cast<unsigned>(height));
  std::vector<Cell> row(static_cast<std::size_t>(width));
  for (int iy = 0; iy < height; ++iy) {
    fill(iy, row.data());
    for (int ix = 0; ix < width; ++ix) {
      grid->setCell(ix, iy, kFreeness[static_cast<std::size_t>(row[static_cast<std::size_t>(ix)])]);
    }
  }
  return {grid, compose(T_map_grid, Pose2{p_grid_corner.x, p_grid_corner.y, 0.0})};
}

OccupancyMap OccupancyMap::movedBy(const Pose2& T_new_map) const {
  OccupancyMap moved = *this;
  moved.T_map_grid_ = compose(T_new_map, T_map_grid_);
  return moved;
}

MapRectangle OccupancyMap::rectangle() const {
  return {
      compose(T_map_grid_, Pose2{p_grid_corner_.x, p_grid_corner_.y, 0.0}),
      width_ * resolution_m_,
      height_ * resolution_m_};
}

Cell OccupancyMap::cell(int ix, int iy) const {
  const float freeness = grid_->getCell(ix, iy);
  if (freeness < kOccupiedBelow) return Cell::kOccupied;
  return freeness > kFreeAbove ? Cell::kFree : Cell::kUnknown;
}

bool OccupancyMap::markFree(int iy, std::uint8_t* row) const {
  using Grid = mrpt::maps::COccupancyGridMap2D;
  const Grid::cellType* cells = grid_->getRow(iy);
  const Grid::cellType limit = Grid::p2l(kOccupiedBelow);
  bool any = false;
  for (int ix = 0; ix < width_; ++ix) {
    const bool occupied = cells[ix] < limit;
    row[ix] = occupied ? 0 : 1;
    any = any || occupied;
  }
  return any;
}

Cell OccupancyMap::at(const Point2& p_map) const {
  return atGrid(transform(inverse(T_map_grid_), p_map));
}

Cell OccupancyMap::atGrid(const Point2& p) const {
  const double fx = std::floor((p.x - p_grid_corner_.x) / resolution_m_);
  const double fy = std::floor((p.y - p_grid_corner_.y) / resolution_m_);
  if (!(fx >= 0.0 && fy >= 0.0 && fx < width_ && fy < height_)) return Cell::kUnknown;
  return cell(static_cast<int>(fx), static_cast<int>(fy));
}

std::size_t OccupancyMap::count(Cell kind) const {
  std::size_t n = 0;
  for (int iy = 0; iy < height_; ++iy) {
    for (int ix = 0; ix < width_; ++ix) n += cell(ix, iy) == kind ? 1U : 0U;
  }
  return n;
}

}  // namespace vestibule::grid
