#pragma once

#include <vector>

#include "vestibule/mapping/params.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::mapping {

/// What an end point lies on, as far as its scan shows.
enum class Surface {
  kWall,    ///< a line: it counts across
  kSpot,    ///< corner, pole, clutter: it counts in both directions
  kUnclear  ///< too far from its neighbours to say; it does not count when a pose is refined
};

/// One end point in the base frame, with the direction of the surface it lies on.
struct ScanPoint {
  double x = 0.0;
  double y = 0.0;
  Surface surface = Surface::kUnclear;
  double nx = 0.0;  ///< unit normal of a wall
  double ny = 0.0;
};

/// A scan as the matcher uses it: end points spread along the contour, in beam order.
struct ScanPoints {
  std::vector<ScanPoint> points;
  double reach_m = 0.0;  ///< most end points are nearer to the base than this
};

[[nodiscard]] ScanPoints matchPoints(const LaserScan& scan, const MatcherParams& params);

}  // namespace vestibule::mapping
