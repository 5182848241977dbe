#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>

namespace vestibule::ekf {

/// Noise of a resting gyro out of how its readings change from one to the next, in which a constant
/// bias is not (von Neumann's mean square successive difference, 1941).
class RestNoise {
 public:
  /// The next reading of this stop. Returns one sigma of a reading [rad/s]: `driving` at first and
  /// at most, else `least` at least.
  double note(const Eigen::Vector3d& rate_radps, double driving, double least) {
    if (previous_) {
      const double variance = (rate_radps - *previous_).squaredNorm() / 6.0;  // 3 axes, twice each
      variance_ += (variance - variance_) / kReadings;
    } else {
      variance_ = driving * driving;
    }
    previous_ = rate_radps;
    return std::min(driving, std::max(least, std::sqrt(variance_)));
  }
  void restart() { previous_.reset(); }

 private:
  static constexpr double kReadings = 30.0;

  std::optional<Eigen::Vector3d> previous_;
  double variance_ = 0.0;
};

}  // namespace vestibule::ekf
