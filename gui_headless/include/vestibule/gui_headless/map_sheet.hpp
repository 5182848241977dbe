#pragma once

#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::gui_headless {

/// Something that happened at a point of a map.
struct MapMark {
  enum class Look { kGood, kOpen, kBad };
  Point2 p_map;
  Look look = Look::kGood;
};

/// A map beside others.
struct MapPanel {
  const grid::OccupancyMap* map = nullptr;  ///< only looked at during the call
  std::vector<std::string> lines;           ///< below the map; some 35 characters fit into one
  std::vector<MapMark> marks = {};          ///< the worse, the larger
};

/// Maps side by side in one scale, each centred on what it knows, in the order given.
/// \param columns  >= 1
/// \param width  of a panel, in the units of the page
/// \return PNG bytes; empty without panels
[[nodiscard]] std::string renderMapSheet(
    const std::vector<MapPanel>& panels, int columns, double width = 210.0);

}  // namespace vestibule::gui_headless
