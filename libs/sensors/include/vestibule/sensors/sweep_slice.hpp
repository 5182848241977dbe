#pragma once

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule {

/// What of a lidar sweep is an obstacle for a robot that stays on the ground.
struct SliceParams {
  double min_height_m = 0.10;  ///< [m] above the ground: lower things are driven over
  double max_height_m = 1.80;  ///< [m] above the ground: higher things are driven under
  /// Ground that rises less is no obstacle.
  double max_slope_rad = degToRad(40.0);
  int beams = 720;            ///< of the scan, over the full circle
  double max_range_m = 30.0;  ///< [m] horizontal
  double min_range_m = 0.2;   ///< [m] nearer echoes are the robot's own
};
void describe(ParamIo& io, SliceParams& p);

/// The nearest obstacle in each direction, as a horizontal scan from the sensor's place. In each
/// vertical plane the ground is followed outwards from the robot's feet: what rises more gently
/// than max_slope is ground, also far up a ramp; what rises more steeply is an obstacle, drawn
/// where it stands on the ground, however high the lidar's rings meet it. A pole in a single
/// direction counts if two echoes of it lie above one another; an echo alone, as dust gives, does
/// not.
///
/// Directions in which only ground was seen are "no echo". The stamp is the sweep's, as if it had
/// been taken at once: deskew the sweep before if the robot turns fast.
[[nodiscard]] LaserScan sliceSweep(const LidarSweep& sweep, const SliceParams& params);

}  // namespace vestibule
