#pragma once

#include <mrpt/obs/CObservation2DRangeScan.h>

#include <optional>

#include "vestibule/sensors/measurements.hpp"

namespace vestibule::io {

/// MRPT's beams lie symmetric about the sensor's x axis: what is left over goes into its yaw. Stamp
/// and label are the caller's.
[[nodiscard]] mrpt::obs::CObservation2DRangeScan toMrpt(const LaserScan& scan);

/// Empty for a scan plane that is not horizontal.
[[nodiscard]] std::optional<LaserScan> fromMrpt(const mrpt::obs::CObservation2DRangeScan& obs);

}  // namespace vestibule::io
