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

/// A one where a bit is set, for each of the 256 bytes.
using Ones = std::array<std::array<std::uint16_t, 8>, 256>;
Ones onesOfBytes() {
  Ones ones{};
  for (std::size_t byte = 0; byte < ones.size(); ++byte) {
    for (std::size_t k = 0; k < 8; ++k) ones[byte][k] = byte >> k & 1U;
  }
  return ones;
}

/// Adds a visit to the cells of a row whose bits are set, up to max_count.
void addVisits(std::uint16_t* visits, std::uint32_t bits, std::uint16_t max_count) {
  static const Ones kOnes = onesOfBytes();
  for (; bits != 0; bits >>= 8U, visits += 8) {
    if ((bits & 255U) == 0) continue;
    const std::uint16_t* ones = kOnes[bits & 255U].data();
    for (int k = 0; k < 8; ++k) {
      visits[k] = std::min(static_cast<std::uint16_t>(visits[k] + ones[k]), max_count);
    }
  }
}

Patch::Ends& endsOf(Patch& patch, std::size_t row, unsigned col) {
  const std::size_t place = patch.place(row, col);
  if (!patch.hasEnds(row, col)) {
    patch.ends.insert(patch.ends.begin() + static_cast<std::ptrdiff_t>(place), Patch::Ends{});
    patch.hit_rows[row] |= 1U << col;
    for (std::size_t r = row + 1; r < Patch::kSide; ++r) ++patch.row_begin[r];
  }
  return patch.ends[place];
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
  Patch& patch = patchAt(ix >> Patch::kBits, iy >> Patch::kBits);
  const auto row = static_cast<std::size_t>(iy & (Patch::kSide - 1));
  const auto col = static_cast<unsigned>(ix & (Patch::kSide - 1));
  Patch::Ends& ends = endsOf(patch, row, col);
  if (counts) {
    std::uint16_t& visits = patch.visits[indexInPatch(ix, iy)];
    if (visits >= map_.max_count_) forget(visits, ends);
    ++ends.hits;
    ++visits;
  }
  const int weight = counts ? ends.hits : ends.hits + 1;
  ends.mean_x = towards(ends.mean_x, x_cells - fx, weight);
  ends.mean_y = towards(ends.mean_y, y_cells - fy, weight);
  map_.refresh(patch, row, col);
}

void PatchMap::Writer::addFree(int px, int py, const std::uint32_t* rows) {
  Patch& patch = patchAt(px, py);
  for (std::size_t row = 0; row < Patch::kSide; ++row) {
    std::uint32_t walls = rows[row] & patch.hit_rows[row];
    addVisits(
        &patch.visits[row * Patch::kSide],
        rows[row] & ~walls,
        static_cast<std::uint16_t>(map_.max_count_));
    for (; walls != 0; walls &= walls - 1) {
      addFreeToWall(patch, row, static_cast<unsigned>(__builtin_ctz(walls)));
    }
  }
}

void PatchMap::Writer::addFreeToWall(Patch& patch, std::size_t row, unsigned col) {
  std::uint16_t& visits = patch.visits[row * Patch::kSide + col];
  if (visits >= map_.max_count_) forget(visits, patch.ends[patch.place(row, col)]);
  ++visits;
  map_.refresh(patch, row, col);
}

void PatchMap::refresh(Patch& patch, std::size_t row, unsigned col) const {
  const std::uint32_t bit = 1U << col;
  const bool is_occupied = occupied(patch.cell(row * Patch::kSide + col));
  patch.occupied_rows[row] =
      is_occupied ? patch.occupied_rows[row] | bit : patch.occupied_rows[row] & ~bit;
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
