#pragma once

#include <vector>

#include "cluster.hpp"
#include "contour.hpp"
#include "vestibule/mapping/scan_node.hpp"

namespace vestibule::mapping {

/// A scan that stands for those around it.
struct KeyScan {
  std::size_t node = 0;  ///< of the drive
  Contour contour;
  double path_m = 0.0;  ///< travelled so far, by the odometry
};

struct KeyScanParams {
  double distance_m = 0.25;  ///< [m] a new key scan after this much motion ...
  double angle_rad = 0.15;   ///< [rad] ... or turn, by the odometry
  double max_range_m = 25.0;
};

/// The first and last scan are among them. \param threads for the contours
[[nodiscard]] std::vector<KeyScan> selectKeyScans(
    const std::vector<ScanNode>& nodes, const KeyScanParams& params, std::size_t threads);

/// These scans as key scans.
/// \param chosen  numbers of nodes, ascending
[[nodiscard]] std::vector<KeyScan> keyScansAt(
    const std::vector<ScanNode>& nodes,
    const std::vector<std::size_t>& chosen,
    double max_range_m,
    std::size_t threads);

/// What the odometry says about the motion from one key scan to a later one.
[[nodiscard]] RelativePrior odometryPrior(
    const std::vector<ScanNode>& nodes, const KeyScan& from, const KeyScan& to);

/// The pose of every node: those of the key scans as given, those between two of them by the
/// odometry with what it is off at the second spread over the way.
[[nodiscard]] std::vector<Pose2> spreadCorrections(
    const std::vector<ScanNode>& nodes,
    const std::vector<KeyScan>& keys,
    const std::vector<Pose2>& T_map_key);

}  // namespace vestibule::mapping
