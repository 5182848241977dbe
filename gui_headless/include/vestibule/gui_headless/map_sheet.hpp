#pragma once

#include <string>
#include <vector>

#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::gui_headless {

/// A map beside others.
struct MapPanel {
  const grid::OccupancyMap* map = nullptr;  ///< only looked at during the call
  std::vector<std::string> lines;           ///< below the map; some 35 characters fit into one
};

/// Maps side by side in one scale, each centred on what it knows, in the order given.
/// \param columns  >= 1
/// \return PNG bytes; empty without panels
[[nodiscard]] std::string renderMapSheet(const std::vector<MapPanel>& panels, int columns);

}  // namespace vestibule::gui_headless
