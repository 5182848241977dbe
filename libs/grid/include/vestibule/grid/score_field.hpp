#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/grid/distance_field.hpp"
#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::grid {

/// How well a point fits, in [0, 1] per cell, stored as bytes, with a pyramid of maxima over
/// squares of 2, 4 and 8 cells: what correlative matching looks up (Olson 2009; Hess et al. 2016).
/// Cells outside score 0. Immutable; share it between threads.
class ScoreField {
 public:
  /// The coarsest level has squares of 2^kTop cells.
  static constexpr int kTop = 3;
  static constexpr int kOne = 255;  ///< the byte that stands for a score of 1

  /// \param T_map_field pose of the lower left corner of cell (0, 0)
  /// \param scores row-major from the bottom left cell, cut to [0, 1]
  /// \param reach_m points farther than this from the base are not looked up
  ScoreField(
      int width,
      int height,
      double resolution_m,
      const Pose2& T_map_field,
      const std::vector<float>& scores,
      double reach_m);

  /// exp(-d^2 / 2 sigma^2) of the distance to the nearest obstacle. With a `cell_m` of several map
  /// cells, each cell gets the best score among them.
  /// \param unknown_score  least score of a cell that nobody has seen: anything may stand there
  static ScoreField fromDistances(
      const OccupancyMap& map,
      const DistanceField& distances,
      double sigma_m,
      double cell_m,
      double reach_m,
      double unknown_score = 0.0);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] double resolution() const { return resolution_m_; }
  [[nodiscard]] double reach() const { return reach_m_; }
  [[nodiscard]] const Pose2& T_map_field() const { return T_map_field_; }
  /// Score of the cell under a point of the map frame.
  [[nodiscard]] double at(const Point2& p_map) const;

  // --- for matchers --------------------------------------------------------------------------
  /// Byte of cell (ix, iy) at a level is the largest score in [ix, ix + 2^h) x [iy, iy + 2^h).
  /// Cells may lie up to padding() outside of the field on every side.
  [[nodiscard]] std::uint8_t value(int level, int ix, int iy) const {
    return levels_[static_cast<std::size_t>(level)][index(ix, iy)];
  }
  [[nodiscard]] int padding() const { return padding_; }
  [[nodiscard]] std::size_t stride() const { return stride_; }
  [[nodiscard]] std::size_t index(int ix, int iy) const {
    return static_cast<std::size_t>(iy + padding_) * stride_ +
           static_cast<std::size_t>(ix + padding_);
  }
  [[nodiscard]] const std::uint8_t* level(int h) const {
    return levels_[static_cast<std::size_t>(h)].data();
  }
  /// The top level sorted within each row by column modulo 2^kTop, so that squares side by side
  /// are bytes side by side: those of columns ix, ix + 2^kTop, ix + 2 * 2^kTop, ...
  [[nodiscard]] const std::uint8_t* topRow(int ix, int iy) const {
    const int x = ix + padding_;
    constexpr int kSize = 1 << kTop;
    return top_by_phase_.data() + static_cast<std::size_t>(iy + padding_) * stride_ +
           static_cast<std::size_t>(x % kSize) * (stride_ / kSize) +
           static_cast<std::size_t>(x / kSize);
  }

 private:
  int width_;
  int height_;
  double resolution_m_;
  double reach_m_;
  int padding_;
  std::size_t stride_;
  Pose2 T_map_field_;
  std::array<std::vector<std::uint8_t>, kTop + 1> levels_;
  std::vector<std::uint8_t> top_by_phase_;
};

}  // namespace vestibule::grid
