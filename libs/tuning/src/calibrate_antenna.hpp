#pragma once

#include "filter_replay.hpp"
#include "vestibule/tuning/calibration.hpp"

namespace vestibule::tuning {

inline constexpr const char* kAntennaX = "antenna x";
inline constexpr const char* kAntennaY = "antenna y";
inline constexpr const char* kGnssLate = "gnss stamps late by";
inline constexpr const char* kWheelsLate = "wheels stamps late by";
inline constexpr const char* kHeadingLate = "heading stamps late by";

/// Lever arm of the antenna and how late the fixes are, together: a late fix of a robot that drives
/// forward looks like an antenna further back. Added to `result` under the names above.
/// \param arm_known  the configured lever arm is the true one
/// \param curve  if given: (delay [s], root mean square of the misfits [m]) with the rest as found
void calibrateAntenna(
    const FilterLog& log,
    const pipeline::Config& config,
    bool arm_known,
    Calibration& result,
    std::vector<std::pair<double, double>>* curve = nullptr);

}  // namespace vestibule::tuning
