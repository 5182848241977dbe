#include "submaps.hpp"

#include <algorithm>

namespace vestibule::mapping {

std::vector<Submap> cutSubmaps(const std::vector<KeyScan>& keys, double submap_m) {
  std::vector<Submap> submaps;
  std::size_t first = 0;
  for (std::size_t k = 0; k < keys.size(); ++k) {
    const bool full = keys[k].path_m - keys[first].path_m >= submap_m;
    if (!full && k + 1 < keys.size()) continue;
    // Half way by travel, not by number: a robot that turns on the spot makes many key scans.
    const double half = 0.5 * (keys[first].path_m + keys[k].path_m);
    std::size_t anchor = first;
    while (anchor < k && keys[anchor].path_m < half) ++anchor;
    submaps.push_back({first, k, anchor});
    first = k + 1;
  }
  return submaps;
}

Cluster clusterOf(
    const Submap& submap,
    const std::vector<KeyScan>& keys,
    const std::vector<Pose2>& T_map_key,
    std::size_t members) {
  const std::size_t n = submap.last - submap.first + 1;
  std::vector<std::size_t> chosen{submap.anchor};
  for (std::size_t i = 0; i + 1 < std::min(n, members); ++i) {
    chosen.push_back(
        submap.first + i * (n - 1) / std::max<std::size_t>(1, std::min(n, members) - 2));
  }
  std::sort(chosen.begin(), chosen.end());
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  Cluster cluster;
  for (const std::size_t k : chosen) {
    if (k > submap.last) continue;
    cluster.members.push_back({&keys[k].contour, between(T_map_key[submap.anchor], T_map_key[k])});
  }
  return cluster;
}

}  // namespace vestibule::mapping
