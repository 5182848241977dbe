#include "vestibule/mapping/sessions.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

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

/// Number of the lower left cell of `map` in the maps that it was drawn from.
std::pair<int, int> firstCell(const grid::OccupancyMap& map) {
  const Pose2 T_map_corner = compose(map.T_map_grid(), Pose2{map.corner().x, map.corner().y, 0.0});
  return {
      static_cast<int>(std::lround(T_map_corner.x / map.resolution())),
      static_cast<int>(std::lround(T_map_corner.y / map.resolution()))};
}

}  // namespace

std::vector<std::uint16_t> SessionCells::seenBy(const grid::OccupancyMap& map, int iy) const {
  const auto [x0, y0] = firstCell(map);
  std::vector<std::uint16_t> row(static_cast<std::size_t>(map.width()), 0);
  for (const auto& [session, own] : maps) {
    const auto bit = static_cast<unsigned>(std::min(session, kMaxSessions) - 1);
    for (std::size_t ix = 0; ix < row.size(); ++ix) {
      if (!own.cell(x0 + static_cast<int>(ix), y0 + iy).seen()) continue;
      row[ix] = static_cast<std::uint16_t>(row[ix] | 1U << bit);
    }
  }
  return row;
}

SessionCells sessionCells(std::map<int, PatchMap> session_maps, const grid::OccupancyMap& map) {
  SessionCells result;
  for (const auto& [session, unused] : session_maps) result.shares.push_back({session});
  const auto [x0, y0] = firstCell(map);
  for (int iy = y0; iy < y0 + map.height(); ++iy) {
    for (int ix = x0; ix < x0 + map.width(); ++ix) {
      std::size_t seers = 0;
      for (const auto& [session, own] : session_maps) seers += own.cell(ix, iy).seen() ? 1U : 0U;
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
  result.maps = std::move(session_maps);
  return result;
}

}  // namespace vestibule::mapping
