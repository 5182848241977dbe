#pragma once

#include <mrpt/obs/CObservation.h>

#include <optional>

#include "vestibule/sensors/measurements.hpp"

namespace mrpt::obs {
class CObservationPointCloud;
}

namespace vestibule::io {

/// The sweep in a Velodyne scan or a point cloud; empty for observations of other classes.
[[nodiscard]] std::optional<LidarSweep> sweepOf(const mrpt::obs::CObservation& observation);

/// A sweep as a point cloud. Rings and times of points are lost: the format has no place for them.
[[nodiscard]] mrpt::obs::CObservationPointCloud cloudOf(const LidarSweep& sweep);

}  // namespace vestibule::io
