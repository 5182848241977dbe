#pragma once

#include "vestibule/core/frames.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::mapping {

/// One scan of a drive that is being mapped: what the filter hands to loop closing and to the joint
/// refinement, and what they hand back.
struct ScanNode {
  LaserScan scan;     ///< deskewed; beams relative to the base at scan.stamp
  Pose2 T_odom_base;  ///< odometry at scan.stamp
  Pose2 T_map_base;   ///< present estimate
};

}  // namespace vestibule::mapping
