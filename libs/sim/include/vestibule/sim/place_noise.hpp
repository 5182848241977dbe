#pragma once

#include <cstdint>

#include "vestibule/core/frames.hpp"

namespace vestibule::sim {

/// Smooth random function of place, zero mean and unit variance everywhere: independent normals on
/// a lattice, blended. Different components are independent.
[[nodiscard]] double placeNoise(
    std::uint64_t seed, int component, const Point2& p_map, double length_m);

/// A uniform number in [0, 1) that belongs to a cell of the given size; for decisions that must
/// come out the same whenever the robot passes.
[[nodiscard]] double placeUniform(
    std::uint64_t seed, int component, const Point2& p_map, double length_m);

}  // namespace vestibule::sim
