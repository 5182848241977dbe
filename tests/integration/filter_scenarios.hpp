#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/ekf/params.hpp"

namespace vestibule::test {

/// What the GNSS filter made of one simulated drive, measured against the truth.
struct FilterDrive {
  struct Sample {
    double t_s = 0.0;
    double error_m = 0.0;
    double yaw_error_rad = 0.0;  ///< signed
    double nees_position = 0.0;  ///< 2 degrees of freedom
    double nees_yaw = 0.0;       ///< 1
    double step_m = 0.0;         ///< of the estimate against the truth since the sample before
    double driven_m = 0.0;
    Pose2 estimate;
  };
  std::vector<Sample> samples;  ///< every 100 ms, from where the filter is ready
  std::optional<double> ready_s;
  std::size_t good_fixes = 0;  ///< while ready and no incident is on
  std::size_t good_refused = 0;
  std::vector<double> offered_s;  ///< when there were fixes, but for those of an incident
  std::vector<double> used_s;     ///< when fixes were used

  [[nodiscard]] const Sample& at(double t_s) const;
  [[nodiscard]] double largestError(double from_s, double to_s) const;
  [[nodiscard]] double largestStep(double from_s, double to_s) const;
};

/// \param scenario  a name of config/scenarios
[[nodiscard]] FilterDrive driveFilter(
    const std::string& scenario, std::uint64_t seed, const ekf::FilterParams& params);

/// Largest differences between both engines, after any measurement of the first `seconds`.
struct EngineDifference {
  std::size_t compared = 0;
  double state = 0.0;
  double covariance = 0.0;
};
[[nodiscard]] EngineDifference engineDifference(const std::string& scenario, double seconds);

/// The parameters of config/filters/simulated_robot.yaml.
[[nodiscard]] ekf::FilterParams simulatedRobotFilter();

}  // namespace vestibule::test
