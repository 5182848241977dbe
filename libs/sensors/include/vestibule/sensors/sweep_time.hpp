#pragma once

#include "vestibule/sensors/measurements.hpp"

namespace vestibule {

/// The mean of the points' stamps: when a sweep that is taken as one instant was measured.
[[nodiscard]] Timestamp meanStamp(const LidarSweep& sweep);

}  // namespace vestibule
