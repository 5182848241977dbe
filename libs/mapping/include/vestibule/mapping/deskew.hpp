#pragma once

#include "vestibule/sensors/measurements.hpp"

namespace vestibule::mapping {

/// The scan as it would have been measured all at once at its stamp, by a robot that moves with a
/// constant twist while the beams are taken. Beams keep equal angles: each takes the range of the
/// contour there. A scan without a time from beam to beam is returned as it is.
/// \param speed_mps    along the base's x axis
/// \param yaw_rate_radps
[[nodiscard]] LaserScan deskewed(const LaserScan& scan, double speed_mps, double yaw_rate_radps);

}  // namespace vestibule::mapping
