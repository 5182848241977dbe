#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/mapping/patch_map.hpp"

namespace vestibule::mapping {

/// What one session (drive) contributed to a map.
struct SessionShare {
  int session = 1;
  std::size_t cells_seen = 0;
  std::size_t cells_alone = 0;         ///< seen by no other session
  std::size_t walls = 0;               ///< cells that are occupied by its scans alone ...
  std::size_t walls_shared = 0;        ///< ... and that other sessions saw, too ...
  std::size_t walls_contradicted = 0;  ///< ... without a wall there or beside it
};

/// Which sessions made which cell of a map.
struct SessionCells {
  static constexpr int kMaxSessions = 16;

  std::vector<SessionShare> shares;  ///< by session
  std::map<int, PatchMap> maps;      ///< per session the map of its scans alone

  /// Per cell of a row of the map of all their scans, from the left: bit n - 1 is set where session
  /// n saw the cell. Sessions from the 16th on share the last bit.
  [[nodiscard]] std::vector<std::uint16_t> seenBy(const grid::OccupancyMap& map, int iy) const;
  /// Whether seenBy() needs more than 8 bits.
  [[nodiscard]] bool wide() const { return !shares.empty() && shares.back().session > 8; }
};

/// \param session_maps  per session the map of its scans alone, in the frame of `map`
/// \param map  of all their scans
[[nodiscard]] SessionCells sessionCells(
    std::map<int, PatchMap> session_maps, const grid::OccupancyMap& map);

}  // namespace vestibule::mapping
