#pragma once

#include <array>

#include "vestibule/mapping/patch_map.hpp"

namespace vestibule::mapping::test {

/// One scan sees through one cell.
inline void seeThrough(PatchMap::Writer& writer, int ix, int iy) {
  constexpr int kMask = Patch::kSide - 1;
  std::array<std::uint32_t, Patch::kSide> rows{};
  rows[static_cast<std::size_t>(iy & kMask)] = 1U << static_cast<unsigned>(ix & kMask);
  writer.addFree(ix >> Patch::kBits, iy >> Patch::kBits, rows.data());
}

}  // namespace vestibule::mapping::test
