#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "vestibule/mapping/params.hpp"
#include "vestibule/mapping/patch_map.hpp"
#include "vestibule/mapping/scan_node.hpp"

namespace vestibule::mapping {

/// The pose of every scan of a drive from those of the used ones: between two of them the odometry,
/// with what it is off at the second spread over the way. A robot that stood until its odometry
/// jumped was where it stood.
/// \param used numbers of the used scans, ascending; those before the first keep their estimate
/// \param path T_map_base of the used scans
[[nodiscard]] std::vector<Pose2> spreadPath(
    const std::vector<ScanNode>& nodes,
    const std::vector<std::size_t>& used,
    const std::vector<Pose2>& path);

/// The map of scans with known poses.
struct PosedScan {
  const LaserScan* scan = nullptr;
  Pose2 T_map_base;
};
[[nodiscard]] PatchMap mapOf(const std::vector<PosedScan>& scans, const FilterMapParams& params);
[[nodiscard]] PatchMap mapOf(const std::vector<ScanNode>& nodes, const FilterMapParams& params);

/// Where in a map a scan was taken, searched in all of it; empty when it fits nowhere well.
[[nodiscard]] std::optional<Pose2> findInMap(
    const PatchMap& map, const LaserScan& scan, const MatcherParams& params);

}  // namespace vestibule::mapping
