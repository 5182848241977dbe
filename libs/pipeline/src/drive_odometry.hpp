#pragma once

#include <optional>
#include <string>

#include "vestibule/core/frames.hpp"
#include "vestibule/ekf/filter.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::pipeline {

/// T_odom_base of a drive at any moment near the last message: by the odometry filter where there
/// is a gyro, else by the wheels' increments alone, which also serves recordings whose stamps run
/// backwards.
class DriveOdometry {
 public:
  DriveOdometry(const Config& config, bool with_gyro);

  void process(const WheelOdometry& wheels);
  void process(const Imu& imu);

  [[nodiscard]] Pose2 at(Timestamp stamp) const;
  [[nodiscard]] double speed() const;    ///< [m/s]
  [[nodiscard]] double yawRate() const;  ///< [rad/s]
  [[nodiscard]] bool any() const { return any_; }

 private:
  std::optional<ekf::MapFilter> filter_;
  Pose2 T_odom_base_;
  Timestamp stamp_;
  Eigen::Vector3d twist_ = Eigen::Vector3d::Zero();  // per second, of the last increment
  bool any_ = false;
};

/// Whether there is an IMU among the first records.
[[nodiscard]] bool hasGyro(const std::string& path, const io::RecordingOptions& options);

}  // namespace vestibule::pipeline
