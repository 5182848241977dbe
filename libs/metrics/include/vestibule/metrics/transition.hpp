#pragma once

#include <cstddef>

#include "vestibule/metrics/trajectory.hpp"

namespace vestibule::metrics {

/// The largest step, and when it ended.
struct Step {
  double position_m = 0.0;
  Timestamp position_stamp;
  double yaw_rad = 0.0;
  Timestamp yaw_stamp;
  std::size_t pairs = 0;  ///< compared
};

/// Largest correction of the published pose within `window`, taken at the base: what
/// T_map_base(t + window) differs from T_map_base(t) carried on by the odometry increment. The
/// robot's own motion does not count. Every later output inside the window is compared, so a
/// correction that is taken back within it is seen; where outputs are rarer than the window, the
/// next one is. Odometry is interpolated at the published stamps; outputs outside its span are
/// skipped. Stamps that run backwards start a new stretch.
[[nodiscard]] Step largestCorrection(
    const Trajectory& T_map_base,
    const Trajectory& T_odom_base,
    Duration window = std::chrono::milliseconds(100));

/// Largest change between consecutive outputs, motion included.
[[nodiscard]] Step largestJump(const Trajectory& T_map_base);

}  // namespace vestibule::metrics
