#pragma once

#include <cstdint>
#include <vector>

#include "kernels.hpp"
#include "vestibule/amcl/params.hpp"
#include "vestibule/grid/distance_field.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::amcl {

/// log(z_hit exp(-d^2 / 2 sigma^2) + z_rand / max_range) per cell of the map, d the exact distance
/// to the nearest obstacle, as 16-bit steps above its smallest value. Cells beyond the map count as
/// far from everything. Immutable.
///
/// MRPT's own likelihood field is not used: turning a scan into its points map drops every beam
/// whose neighbour is left out, so a thinned scan keeps almost none, and it evaluates sine, cosine
/// and logarithm per beam.
class LikelihoodTable {
 public:
  LikelihoodTable(
      const grid::OccupancyMap& map,
      const grid::DistanceField& field,
      const LikelihoodField& params);

  [[nodiscard]] TableView view() const { return {values_.data(), width_, height_}; }

  /// Fixed-point table coordinate of a grid coordinate [m].
  [[nodiscard]] std::int32_t fixedX(float x_m) const { return fixed(x_m - corner_x_); }
  [[nodiscard]] std::int32_t fixedY(float y_m) const { return fixed(y_m - corner_y_); }
  /// Fixed-point length [m].
  [[nodiscard]] std::int32_t fixedLength(float length_m) const {
    return static_cast<std::int32_t>(length_m * fixed_per_m_ + (length_m < 0.0F ? -0.5F : 0.5F));
  }
  /// The log-likelihood behind a sum over that many beams.
  [[nodiscard]] double logLikelihood(std::uint32_t sum, std::size_t beams) const {
    return static_cast<double>(sum) * step_ + static_cast<double>(beams) * smallest_;
  }

  /// Log-likelihood of beam ends in base axes at a pose of the grid frame.
  [[nodiscard]] double logLikelihood(
      const Pose2& T_grid_base, const std::vector<Point2>& ends) const;

 private:
  [[nodiscard]] std::int32_t fixed(float from_corner_m) const {
    // Far outside is far outside: kept within the range of the integers.
    constexpr float kLimit = 1.0e9F;
    const float value = (from_corner_m * cells_per_m_ + 1.0F) * (1 << kFractionBits);
    return static_cast<std::int32_t>(value < -kLimit ? -kLimit : value > kLimit ? kLimit : value);
  }

  std::vector<std::uint16_t> values_;
  std::int32_t width_;  ///< with the border of one cell
  std::int32_t height_;
  double step_;
  double smallest_;
  float cells_per_m_;
  float fixed_per_m_;
  float corner_x_;
  float corner_y_;
};

}  // namespace vestibule::amcl
