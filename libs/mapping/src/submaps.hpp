#pragma once

#include <vector>

#include "key_scans.hpp"

namespace vestibule::mapping {

/// A stretch of the drive that is rigid while places are compared.
struct Submap {
  std::size_t first = 0;   ///< key scan
  std::size_t last = 0;    ///< key scan, inclusive
  std::size_t anchor = 0;  ///< key scan in the middle; the submap's frame
};
[[nodiscard]] std::vector<Submap> cutSubmaps(const std::vector<KeyScan>& keys, double submap_m);

/// At most `members` of its key scans, spread evenly, the anchor among them, in the anchor's frame.
[[nodiscard]] Cluster clusterOf(
    const Submap& submap,
    const std::vector<KeyScan>& keys,
    const std::vector<Pose2>& T_map_key,
    std::size_t members);

}  // namespace vestibule::mapping
