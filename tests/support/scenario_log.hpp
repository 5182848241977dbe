#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "vestibule/metrics/trajectory.hpp"
#include "vestibule/sim/scenario.hpp"

namespace vestibule::test {

/// A shipped scenario by name.
[[nodiscard]] sim::Scenario shippedScenario(const std::string& name);

/// Drives a scenario to its end.
/// \param measurement  gets what reaches the computer, in that order; may be empty
/// \return the true T_map_base every 20 ms
metrics::Trajectory driveScenario(
    const sim::Scenario& scenario,
    std::uint64_t seed,
    const std::function<void(const Measurement&)>& measurement);

/// Drives it and leaves the recording in a rawlog, labelled as `vestibule sim` does.
metrics::Trajectory recordScenario(
    const sim::Scenario& scenario, std::uint64_t seed, const std::string& rawlog_path);

}  // namespace vestibule::test
