#pragma once

#include <functional>
#include <vector>

#include "vestibule/mapping/scan_node.hpp"

namespace vestibule::mapping {

/// Told now and then the share done, 0..1. May throw to end the work early.
using ShareDone = std::function<void(double)>;

struct TrackParams {
  int window = 10;               ///< key scans that the next one is matched with
  double poor_agreement = 0.85;  ///< below it the match is searched for in a wider window
  double search_m = 1.5;
  double search_rad = 0.45;
};

struct TrackResult {
  std::vector<ScanNode> nodes;  ///< with T_map_base from the scans
  std::size_t slips = 0;        ///< places where the odometry was far from what the scans say
};

/// Sequential scan matching: each scan against those before it, from the odometry's guess, with a
/// wider search where the guess does not fit (wheels that slipped). Drifts; closes no loop.
/// Starts at the first node's T_map_base.
[[nodiscard]] TrackResult trackScans(
    std::vector<ScanNode> nodes,
    const TrackParams& params,
    int threads,
    const ShareDone& progress = {});

}  // namespace vestibule::mapping
