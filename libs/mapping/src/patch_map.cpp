#include "vestibule/mapping/patch_map.hpp"

#include <algorithm>

namespace vestibule::mapping {
namespace {

constexpr double kFraction = 65536.0;

std::uint16_t towards(std::uint16_t mean, double fraction, int hits) {
  const double moved =
      static_cast<double>(mean) + (fraction * kFraction - static_cast<double>(mean)) / hits;
  return static_cast<std::uint16_t>(std::clamp(std::lround(moved), 0L, 65535L));
}

/// The ratio stays, newer scans count more.
void forget(PointCell& cell) {
  cell.visits = static_cast<std::uint16_t>(cell.visits / 2);
  cell.hits = static_cast<std::uint16_t>(cell.hits / 2);
}

}  // namespace

PatchMap::PatchMap(double resolution_m, double occupied_ratio, int max_count)
    : resolution_m_(resolution_m),
      cells_per_m_(1.0 / resolution_m),
      occupied_ratio_(occupied_ratio),
      max_count_(max_count) {}

void PatchMap::Writer::addHit(double x_cells, double y_cells, bool counts) {
  const double fx = std::floor(x_cells);
  const double fy = std::floor(y_cells);
  const int ix = static_cast<int>(fx);
  const int iy = static_cast<int>(fy);
  Patch& patch = patchOf(ix, iy);
  PointCell& cell = patch.cells[indexInPatch(ix, iy)];
  if (counts) {
    if (cell.visits >= map_.max_count_) forget(cell);
    ++cell.hits;
    ++cell.visits;
  }
  const int weight = counts ? cell.hits : cell.hits + 1;
  cell.mean_x = towards(cell.mean_x, x_cells - fx, weight);
  cell.mean_y = towards(cell.mean_y, y_cells - fy, weight);
  map_.refresh(patch, ix, iy);
}

void PatchMap::Writer::addFreeToWall(Patch& patch, int ix, int iy) {
  PointCell& cell = patch.cells[indexInPatch(ix, iy)];
  if (cell.visits >= map_.max_count_) forget(cell);
  ++cell.visits;
  map_.refresh(patch, ix, iy);
}

void PatchMap::refresh(Patch& patch, int ix, int iy) const {
  constexpr int kMask = Patch::kSide - 1;
  std::uint32_t& row = patch.occupied_rows[static_cast<std::size_t>(iy & kMask)];
  const std::uint32_t bit = 1U << static_cast<unsigned>(ix & kMask);
  row = occupied(patch.cells[indexInPatch(ix, iy)]) ? row | bit : row & ~bit;
}

Patch& PatchMap::ownPatch(int px, int py) {
  if (px < px0_ || py < py0_ || px >= px0_ + columns_ || py >= py0_ + rows_) growTo(px, py);
  return table_
      [static_cast<std::size_t>(py - py0_) * static_cast<std::size_t>(columns_) +
       static_cast<std::size_t>(px - px0_)]
          .own();
}

void PatchMap::growTo(int px, int py) {
  constexpr int kSpare = 2;
  int x0 = px - kSpare;
  int y0 = py - kSpare;
  int x1 = px + kSpare + 1;
  int y1 = py + kSpare + 1;
  if (columns_ > 0) {
    x0 = px < px0_ ? x0 : px0_;
    y0 = py < py0_ ? y0 : py0_;
    x1 = px >= px0_ + columns_ ? x1 : px0_ + columns_;
    y1 = py >= py0_ + rows_ ? y1 : py0_ + rows_;
  }
  const int columns = x1 - x0;
  const int rows = y1 - y0;
  std::vector<PatchRef> table(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  for (int row = 0; row < rows_; ++row) {
    for (int col = 0; col < columns_; ++col) {
      table
          [static_cast<std::size_t>(row + py0_ - y0) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(col + px0_ - x0)] =
              std::move(table_
                            [static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                             static_cast<std::size_t>(col)]);
    }
  }
  table_ = std::move(table);
  px0_ = x0;
  py0_ = y0;
  columns_ = columns;
  rows_ = rows;
}

}  // namespace vestibule::mapping
