#pragma once

#include "filter_replay.hpp"
#include "vestibule/tuning/calibration.hpp"

namespace vestibule::tuning {

inline constexpr const char* kAntennaX = "antenna x";
inline constexpr const char* kAntennaY = "antenna y";
inline constexpr const char* kGnssLate = "gnss stamps late by";

/// Lever arm of the antenna and how late the fixes are, together: a late fix of a robot that drives
/// forward looks like an antenna further back. Added to `result` under the names above.
void calibrateAntenna(const FilterLog& log, const pipeline::Config& config, Calibration& result);

}  // namespace vestibule::tuning
