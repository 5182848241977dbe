#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>

#include "missing_way.hpp"
#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::amcl {

/// The odometry as one path in a frame of its own, remembered for a while, so that a scan finds the
/// pose at its own stamp however late it comes. Readings with borrowed stamps are carried on by
/// what they miss.
class OdometryTrack {
 public:
  void add(const WheelOdometry& odometry);

  [[nodiscard]] const Pose2& now() const { return T_odom_base_; }
  /// Between two messages interpolated; shortly after the last one carried on with its speed. A
  /// stamp the path does not cover (recordings whose clocks disagree) gets the present pose.
  [[nodiscard]] Pose2 at(Timestamp stamp) const;
  /// Body speed at the last message: x, y [m/s], yaw [rad/s]; zero where it is not known.
  [[nodiscard]] const Eigen::Vector3d& twist() const { return twist_; }
  /// Of the present pose, along the way: how well the time of its reading is known.
  [[nodiscard]] double timingVar_m2() const { return missing_ ? missing_->var_m2() : 0.0; }

 private:
  struct Stamped {
    Timestamp stamp;
    Pose2 T_odom_base;
  };
  std::deque<Stamped> path_;
  Pose2 T_odom_read_;                  // the sum of the increments
  std::optional<MissingWay> missing_;  // of readings with borrowed stamps
  Pose2 T_odom_base_;
  Eigen::Vector3d twist_ = Eigen::Vector3d::Zero();
  double period_s_ = 0.0;
};

}  // namespace vestibule::amcl
