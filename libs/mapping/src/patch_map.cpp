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

/// Makes room for another count: the ratio stays, newer scans count more.
void forget(std::uint16_t& visits, Patch::Ends& ends) {
  visits = static_cast<std::uint16_t>(visits / 2);
  ends.hits = static_cast<std::uint16_t>(ends.hits / 2);
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
  if (!patch.ends) patch.ends = std::make_unique<std::array<Patch::Ends, Patch::kCells>>();
  const std::size_t index = indexInPatch(ix, iy);
  Patch::Ends& ends = (*patch.ends)[index];
  if (counts) {
    if (patch.visits[index] >= map_.max_count_) forget(patch.visits[index], ends);
    ++ends.hits;
    ++patch.visits[index];
  }
  const int weight = counts ? ends.hits : ends.hits + 1;
  ends.mean_x = towards(ends.mean_x, x_cells - fx, weight);
  ends.mean_y = towards(ends.mean_y, y_cells - fy, weight);
  map_.refresh(patch, ix, iy);
}

void PatchMap::Writer::addFreeToWall(Patch& patch, int ix, int iy) {
  const std::size_t index = indexInPatch(ix, iy);
  if (patch.visits[index] >= map_.max_count_) forget(patch.visits[index], (*patch.ends)[index]);
  ++patch.visits[index];
  map_.refresh(patch, ix, iy);
}

void PatchMap::refresh(Patch& patch, int ix, int iy) const {
  constexpr int kMask = Patch::kSide - 1;
  const auto row = static_cast<std::size_t>(iy & kMask);
  const std::uint32_t bit = 1U << static_cast<unsigned>(ix & kMask);
  const PointCell cell = patch.cell(indexInPatch(ix, iy));
  const auto set = [bit](std::uint32_t& bits, bool on) { bits = on ? bits | bit : bits & ~bit; };
  set(patch.hit_rows[row], cell.hits > 0);
  set(patch.occupied_rows[row], occupied(cell));
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
