#include "vestibule/mapping/sessions.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::mapping {
namespace {

bool wallAround(const PatchMap& map, int ix, int iy) {
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if (map.occupied(map.cell(ix + dx, iy + dy))) return true;
    }
  }
  return false;
}

}  // namespace

SessionCells sessionCells(
    const std::map<int, PatchMap>& session_maps, const grid::OccupancyMap& map) {
  SessionCells result;
  for (const auto& [session, unused] : session_maps) result.shares.push_back({session});
  result.seen_by.reserve(
      static_cast<std::size_t>(map.width()) * static_cast<std::size_t>(map.height()));
  const Pose2 T_map_corner = compose(map.T_map_grid(), Pose2{map.corner().x, map.corner().y, 0.0});
  const int x0 = static_cast<int>(std::lround(T_map_corner.x / map.resolution()));
  const int y0 = static_cast<int>(std::lround(T_map_corner.y / map.resolution()));
  for (int iy = y0; iy < y0 + map.height(); ++iy) {
    for (int ix = x0; ix < x0 + map.width(); ++ix) {
      std::uint16_t seen_by = 0;
      std::size_t seers = 0;
      for (const auto& [session, own] : session_maps) {
        if (!own.cell(ix, iy).seen()) continue;
        ++seers;
        const int bit = std::min(session, SessionCells::kMaxSessions) - 1;
        seen_by = static_cast<std::uint16_t>(seen_by | 1U << static_cast<unsigned>(bit));
      }
      result.seen_by.push_back(seen_by);
      std::size_t k = 0;
      for (auto it = session_maps.begin(); it != session_maps.end(); ++it, ++k) {
        const PointCell cell = it->second.cell(ix, iy);
        if (!cell.seen()) continue;
        SessionShare& share = result.shares[k];
        ++share.cells_seen;
        if (seers == 1) ++share.cells_alone;
        if (!it->second.occupied(cell)) continue;
        ++share.walls;
        if (seers == 1) continue;
        ++share.walls_shared;
        const bool confirmed =
            std::any_of(session_maps.begin(), session_maps.end(), [&](const auto& other) {
              return other.first != it->first && wallAround(other.second, ix, iy);
            });
        if (!confirmed) ++share.walls_contradicted;
      }
    }
  }
  return result;
}

}  // namespace vestibule::mapping
