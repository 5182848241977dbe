#pragma once

#include <optional>

#include "vestibule/ekf/params.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::ekf {

/// What absolute measurements are worth by themselves, before an estimate is there to hold them
/// against.

/// Least standard deviation per axis of fixes of a type [m].
[[nodiscard]] double leastSigma(GnssFixType type, const GnssParams& params);

/// Standard deviation of a heading as a yaw in ENU [rad], with what mounting, declination and steel
/// do to it; empty for a sensor that is neither calibrated nor trusted (InitParams::trust_heading),
/// or doubts itself.
[[nodiscard]] std::optional<double> absoluteSigma(
    const Heading& heading, const FilterParams& params);

}  // namespace vestibule::ekf
