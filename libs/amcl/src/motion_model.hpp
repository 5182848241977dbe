#pragma once

#include "kernels.hpp"
#include "vestibule/amcl/params.hpp"
#include "vestibule/core/frames.hpp"

namespace vestibule::amcl {

/// What the odometry said since the last update.
struct Motion {
  Pose2 T_from_to;
  double travelled_m = 0.0;  ///< along the path, at least the length of T_from_to
  double turned_rad = 0.0;   ///< sum of the turns' sizes
  double gyro_rad = 0.0;     ///< the part of turned_rad that a gyro measured
  double timing_m = 0.0;     ///< one sigma along the way of not knowing when it was read
};

/// The increment the robot really made, with its covariance: T_from_to in the axes of `from`, the
/// covariance about `to` in the same axes.
[[nodiscard]] PoseWithCovariance likelyMotion(const Motion& motion, const MotionNoise& noise);

/// As the particle kernel wants it.
[[nodiscard]] NoisyIncrement noisyIncrement(const PoseWithCovariance& increment);

}  // namespace vestibule::amcl
