#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "vestibule/core/simd.hpp"

namespace vestibule::amcl {

// The loops that see every particle. Portable or with AVX2 they give the same bits: random words
// and table sums are integers, and each particle's floats are computed by themselves in a fixed
// order. Measured by amcl_bench.

/// Particle arrays are padded to whole blocks of this many.
inline constexpr std::size_t kLanes = 8;
[[nodiscard]] constexpr std::size_t padded(std::size_t n) {
  return (n + kLanes - 1) / kLanes * kLanes;
}

/// Names the random words of one use: particle i draws from counter (i, purpose, step).
struct NoiseKey {
  std::array<std::uint32_t, 2> seed{};
  std::uint32_t purpose = 0;
  std::uint64_t step = 0;
};

/// A body-frame increment every particle makes, mean + factor * z with z standard normal.
/// `factor` is lower triangular, row-major: xx, yx, yy, tx, ty, tt.
struct NoisyIncrement {
  std::array<float, 3> mean{};
  std::array<float, 6> factor{};
};

struct ParticleArrays {
  float* x = nullptr;    ///< [m], grid frame
  float* y = nullptr;    ///< [m]
  float* yaw = nullptr;  ///< [rad], in [-pi, pi)
};

/// Moves particles [begin, end) by increments of their own. \pre begin is a multiple of kLanes
void propagate(
    const ParticleArrays& particles,
    std::size_t begin,
    std::size_t end,
    const NoisyIncrement& increment,
    const NoiseKey& key,
    Simd simd);

/// The table a scan is summed over: 16-bit values, row-major, a border of one cell that stands for
/// everything outside. Coordinates are fixed point, kFractionBits below the cell.
struct TableView {
  const std::uint16_t* values = nullptr;  ///< two more readable bytes follow the last
  std::int32_t width = 0;                 ///< of the table with its border
  std::int32_t height = 0;
};
inline constexpr int kFractionBits = 12;

/// Adds to sum[k] the sum over the beams of table(position k + beam), for count positions. The
/// beams' arrays hold `beams` entries, which may be any number.
/// \param inside every sum of position and beam is known to fall into the table
void sumOverBeams(
    const TableView& table,
    const std::int32_t* beam_x,
    const std::int32_t* beam_y,
    std::size_t beams,
    const std::int32_t* x,
    const std::int32_t* y,
    std::size_t count,
    bool inside,
    std::uint32_t* sum,
    Simd simd);

}  // namespace vestibule::amcl
