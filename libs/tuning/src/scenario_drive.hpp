#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "vestibule/metrics/trajectory.hpp"
#include "vestibule/sensors/measurements.hpp"
#include "vestibule/sensors/rig.hpp"
#include "vestibule/sim/scenario.hpp"

namespace vestibule::tuning {

/// What a drive in the simulator leaves.
struct ScenarioDrive {
  std::vector<Measurement> measurements;
  metrics::Trajectory truth;
};
/// Drives a scenario to its end. Sweeps of ring lidars are left out.
[[nodiscard]] ScenarioDrive driveScenario(const sim::Scenario& scenario, std::uint64_t seed);

/// A recording in the folder for temporary files, which goes with the object.
class TemporaryRecording {
 public:
  /// Throws InputError when it cannot be written.
  explicit TemporaryRecording(const std::vector<Measurement>& measurements);
  TemporaryRecording(const TemporaryRecording&) = delete;
  TemporaryRecording& operator=(const TemporaryRecording&) = delete;
  ~TemporaryRecording();
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace vestibule::tuning
