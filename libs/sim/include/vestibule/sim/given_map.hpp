#pragma once

#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/sim/world.hpp"

namespace vestibule::sim {

/// The world as it stood on the day of the survey.
[[nodiscard]] World worldAtSurvey(const World& world, const GivenMap& given);

/// The prior map a mapping robot made on that day: free where its beams passed, occupied where they
/// ended, unknown elsewhere. Deterministic. Its T_map_grid is the true one.
[[nodiscard]] grid::OccupancyMap surveyMap(const World& world, const GivenMap& given);

}  // namespace vestibule::sim
