#pragma once

#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace vestibule::mapping {

/// What the filter knows of a cell. The mean of the end points that fell into it keeps walls where
/// they were measured, not where cell centres are.
struct PointCell {
  std::uint16_t hits = 0;    ///< end points
  std::uint16_t visits = 0;  ///< scans that saw the cell, hits included
  std::uint16_t mean_x = 0;  ///< of the end points, from the cell's lower left corner, 2^-16 cells
  std::uint16_t mean_y = 0;

  [[nodiscard]] bool seen() const { return visits > 0; }
  /// Enough of those who saw it met an obstacle.
  [[nodiscard]] bool occupied(double ratio) const {
    return hits > 0 && static_cast<double>(hits) >= ratio * static_cast<double>(visits);
  }
};

/// 32 x 32 cells. Free space, most of any map, costs a count per cell; cells with end points have
/// what more they need in a list, in the order of the cells.
struct Patch {
  static constexpr int kBits = 5;
  static constexpr int kSide = 1 << kBits;
  static constexpr std::size_t kCells = std::size_t{kSide} * kSide;

  /// What a cell with end points holds besides its visits.
  struct Ends {
    std::uint16_t hits = 0;
    std::uint16_t mean_x = 0;
    std::uint16_t mean_y = 0;
  };

  Patch() = default;
  Patch(const Patch& other)
      : visits(other.visits),
        hit_rows(other.hit_rows),
        occupied_rows(other.occupied_rows),
        row_begin(other.row_begin),
        ends(other.ends) {}
  Patch& operator=(const Patch&) = delete;
  ~Patch() = default;

  [[nodiscard]] bool hasEnds(std::size_t row, unsigned col) const {
    return (hit_rows[row] >> col & 1U) != 0;
  }
  /// Where in `ends` the cell's are, or belong.
  [[nodiscard]] std::size_t place(std::size_t row, unsigned col) const {
    return row_begin[row] + bitCount(hit_rows[row] & ((1U << col) - 1U));
  }
  [[nodiscard]] PointCell cell(std::size_t index) const {
    const std::size_t row = index >> kBits;
    const auto col = static_cast<unsigned>(index & (kSide - 1));
    if (!hasEnds(row, col)) return {0, visits[index], 0, 0};
    const Ends& e = ends[place(row, col)];
    return {e.hits, visits[index], e.mean_x, e.mean_y};
  }
  [[nodiscard]] std::size_t bytes() const { return sizeof(Patch) + ends.capacity() * sizeof(Ends); }

  static unsigned bitCount(std::uint32_t bits) {
    bits -= bits >> 1U & 0x55555555U;
    bits = (bits & 0x33333333U) + (bits >> 2U & 0x33333333U);
    return ((bits + (bits >> 4U)) & 0x0F0F0F0FU) * 0x01010101U >> 24U;
  }

  std::array<std::uint16_t, kCells> visits{};
  std::array<std::uint32_t, kSide> hit_rows{};       ///< a bit per cell that has end points
  std::array<std::uint32_t, kSide> occupied_rows{};  ///< a bit per occupied cell
  std::array<std::uint16_t, kSide> row_begin{};      ///< of each row in `ends`
  std::vector<Ends> ends;
  std::atomic<std::uint32_t> owners{1};
};

/// Shared ownership of a patch; who is not alone copies before writing. Two maps that share a patch
/// may be changed from two threads at once, one map from one thread only.
class PatchRef {
 public:
  PatchRef() = default;
  PatchRef(const PatchRef& other) : patch_(other.patch_) {
    if (patch_ != nullptr) patch_->owners.fetch_add(1, std::memory_order_relaxed);
  }
  PatchRef(PatchRef&& other) noexcept : patch_(std::exchange(other.patch_, nullptr)) {}
  PatchRef& operator=(PatchRef other) noexcept {
    std::swap(patch_, other.patch_);
    return *this;
  }
  ~PatchRef() {
    if (patch_ != nullptr && patch_->owners.fetch_sub(1, std::memory_order_acq_rel) == 1) {
      delete patch_;
    }
  }

  [[nodiscard]] const Patch* get() const { return patch_; }
  /// The patch for writing: new where there was none, a copy where others share it.
  [[nodiscard]] Patch& own() {
    if (patch_ == nullptr) {
      patch_ = new Patch;
    } else if (patch_->owners.load(std::memory_order_acquire) != 1) {
      PatchRef copy;
      copy.patch_ = new Patch(*patch_);
      std::swap(patch_, copy.patch_);
    }
    return *patch_;
  }

 private:
  Patch* patch_ = nullptr;
};

/// An occupancy map that grows as it is written and shares its patches with its copies: a copy
/// costs a table of pointers. Cell (ix, iy) spans [ix, ix + 1) x [iy, iy + 1) cells from the origin
/// of the map frame.
class PatchMap {
 public:
  /// \param occupied_ratio hits per visit from which a cell counts as occupied
  /// \param max_count hits and visits stop here, so that the map can forget
  PatchMap(double resolution_m = 0.05, double occupied_ratio = 0.25, int max_count = 250);

  [[nodiscard]] double resolution() const { return resolution_m_; }
  [[nodiscard]] int cellOf(double metres) const {
    return static_cast<int>(std::floor(metres * cells_per_m_));
  }
  [[nodiscard]] bool occupied(const PointCell& cell) const {
    return cell.occupied(occupied_ratio_);
  }

  /// Null where nothing was seen yet.
  [[nodiscard]] const Patch* patch(int px, int py) const {
    const int col = px - px0_;
    const int row = py - py0_;
    if (col < 0 || row < 0 || col >= columns_ || row >= rows_) return nullptr;
    return table_
        [static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
         static_cast<std::size_t>(col)]
            .get();
  }
  [[nodiscard]] PointCell cell(int ix, int iy) const {
    const Patch* p = patch(ix >> Patch::kBits, iy >> Patch::kBits);
    return p == nullptr ? PointCell{} : p->cell(indexInPatch(ix, iy));
  }
  [[nodiscard]] static std::size_t indexInPatch(int ix, int iy) {
    constexpr int kMask = Patch::kSide - 1;
    return static_cast<std::size_t>((iy & kMask) << Patch::kBits | (ix & kMask));
  }

  /// Writes into the map; remembers the patch it wrote into last. Keep it for one scan only: while
  /// it lives the map must not be copied.
  class Writer {
   public:
    explicit Writer(PatchMap& map) : map_(map) {}
    /// An end point at (x, y) in cells.
    /// \param counts false: a further end point of one scan in a cell; it moves the mean only
    void addHit(double x_cells, double y_cells, bool counts = true);
    /// Beams went through these cells of a patch: a word per row, a bit per cell.
    void addFree(int px, int py, const std::uint32_t* rows);

   private:
    Patch& patchAt(int px, int py) {
      if (last_ == nullptr || px != px_ || py != py_) {
        last_ = &map_.ownPatch(px, py);
        px_ = px;
        py_ = py;
      }
      return *last_;
    }
    void addFreeToWall(Patch& patch, std::size_t row, unsigned col);

    PatchMap& map_;
    Patch* last_ = nullptr;
    int px_ = 0;
    int py_ = 0;
  };

  /// Bounds in patches: columns [x0, x0 + columns), rows [y0, y0 + rows); empty map: none.
  struct Extent {
    int x0 = 0, y0 = 0, columns = 0, rows = 0;
  };
  [[nodiscard]] Extent extent() const { return {px0_, py0_, columns_, rows_}; }
  /// All patch references, for counting what maps share.
  [[nodiscard]] const std::vector<PatchRef>& table() const { return table_; }

 private:
  Patch& ownPatch(int px, int py);
  void growTo(int px, int py);
  void refresh(Patch& patch, std::size_t row, unsigned col) const;

  double resolution_m_;
  double cells_per_m_;
  double occupied_ratio_;
  int max_count_;
  int px0_ = 0, py0_ = 0, columns_ = 0, rows_ = 0;
  std::vector<PatchRef> table_;
};

}  // namespace vestibule::mapping
