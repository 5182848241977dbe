#pragma once

#include <cstddef>
#include <vector>

#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/mapping/params.hpp"
#include "vestibule/mapping/patch_map.hpp"
#include "vestibule/mapping/scan_node.hpp"

namespace vestibule::mapping {

/// The map decided cell by cell into free, occupied and unknown, cut to what was seen.
/// \param margin_m unknown rim kept around it
[[nodiscard]] grid::OccupancyMap toOccupancyMap(const PatchMap& map, double margin_m);

/// Figures of a map that need no truth. They compare maps of one recording: a map that is warped as
/// a whole can still score well.
struct MapQuality {
  double entropy_bit = 0.0;       ///< mean over seen cells of the entropy of their occupancy
  double wall_thickness_m = 0.0;  ///< area of occupied cells over half their outline
  std::size_t held_out_scans = 0;
  double held_out_log_likelihood = 0.0;  ///< per beam, mean over scans that are not in the map
  double held_out_matched_share = 0.0;   ///< of their beams, on mapped obstacles
};

/// \param held_out scans that were not written into the map, with their poses; each is matched
///                 from there, so that it is the map that is judged
[[nodiscard]] MapQuality judgeMap(
    const PatchMap& map, const std::vector<ScanNode>& held_out, const MatcherParams& params);

}  // namespace vestibule::mapping
