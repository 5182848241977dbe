#pragma once

#include "vestibule/core/params.hpp"
#include "vestibule/core/time.hpp"

namespace vestibule::sim {

/// The truth moves in these steps.
inline constexpr Duration kTruthStep = std::chrono::milliseconds(5);

/// Reads `rate_hz`, which must divide the rate of the truth, 200 Hz.
void rateField(ParamIo& io, double& rate_hz);

/// Whether a sensor of this rate measures at the given truth step (counted from 1).
[[nodiscard]] bool due(std::uint64_t step, double rate_hz);

}  // namespace vestibule::sim
