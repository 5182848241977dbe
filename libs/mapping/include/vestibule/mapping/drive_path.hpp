#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "vestibule/mapping/params.hpp"
#include "vestibule/mapping/patch_map.hpp"
#include "vestibule/mapping/scan_node.hpp"

namespace vestibule::mapping {

/// Sets the estimate of every scan of a drive from those of the used ones: between two of them the
/// odometry, with what it is off at the second spread over the way.
/// \param used numbers of the used scans, ascending, from 0
/// \param path T_map_base of the used scans
void spreadPath(
    std::vector<ScanNode>& nodes,
    const std::vector<std::size_t>& used,
    const std::vector<Pose2>& path);

/// The map of scans with known poses.
[[nodiscard]] PatchMap mapOf(const std::vector<ScanNode>& nodes, const FilterMapParams& params);

/// Where in a map a scan was taken, searched in all of it; empty when it fits nowhere well.
[[nodiscard]] std::optional<Pose2> findInMap(
    const PatchMap& map, const LaserScan& scan, const MatcherParams& params);

}  // namespace vestibule::mapping
