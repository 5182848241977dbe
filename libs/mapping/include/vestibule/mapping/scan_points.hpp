#pragma once

#include <vector>

#include "vestibule/mapping/params.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::mapping {

/// One end point in the base frame, with the direction of the surface it lies on.
struct ScanPoint {
  double x = 0.0;
  double y = 0.0;
  double nx = 0.0;  ///< unit normal of the surface, where it is one
  double ny = 0.0;
  bool on_line = false;  ///< false: corner, pole, clutter; it counts in both directions
};

/// A scan as the matcher uses it: end points spread along the contour, in beam order.
struct ScanPoints {
  std::vector<ScanPoint> points;
  double reach_m = 0.0;  ///< most end points are nearer to the base than this
};

[[nodiscard]] ScanPoints matchPoints(const LaserScan& scan, const MatcherParams& params);

}  // namespace vestibule::mapping
