#pragma once

#include <string>
#include <utility>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::gui_headless {

/// What surrounds a run, all in the map frame. Every part may be missing. Pointers are only looked
/// at during the call that takes the scene.
struct Scene {
  std::vector<const grid::OccupancyMap*> prior_maps;
  const geo::Site* site = nullptr;
  std::vector<std::pair<Point2, Point2>> truth_walls;    ///< of the simulated world
  std::vector<std::pair<std::string, Pose2>> waypoints;  ///< names and T_map_waypoint
  std::vector<std::pair<Timestamp, Pose2>> reference;    ///< ground truth, stamps ascending
  std::vector<Point2> gnss_fixes;                        ///< raw fixes
  /// Two moments of a drive that were taken for one place, rightly or not.
  struct Closure {
    Point2 from;
    Point2 to;
    bool accepted = true;
  };
  std::vector<Closure> closures;
};

}  // namespace vestibule::gui_headless
