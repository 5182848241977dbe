#pragma once

#include <cstddef>
#include <cstdint>

#include "vestibule/core/angles.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule {

/// Wheels that slip: what the odometry tells and the robot does not do.
struct SlipParams {
  double every_s = 60.0;           ///< [s] of the recording between the beginnings of two slips
  double distance_m = 1.0;         ///< [m] in a direction drawn at random
  double turn_rad = degToRad(20);  ///< [rad] to a side drawn at random
  double lasts_s = 1.0;            ///< [s] spread over so long; 0 = between two messages
};

/// Puts slips into the odometry of a recording, to try out what a map or a filter makes of them.
/// The same seed gives the same slips.
class SlipMaker {
 public:
  SlipMaker(const SlipParams& params, std::uint64_t seed) : params_(params), seed_(seed) {}

  /// Call for every odometry message in the order of the recording.
  void apply(WheelOdometry& odometry);
  [[nodiscard]] std::size_t count() const { return count_; }

 private:
  SlipParams params_;
  std::uint64_t seed_;
  std::size_t count_ = 0;
  bool started_ = false;
  Timestamp last_;
  double since_s_ = 0.0;  // the last slip began, or the recording
  double left_ = 0.0;     // share of the present slip
  Pose2 slip_;
};

}  // namespace vestibule
