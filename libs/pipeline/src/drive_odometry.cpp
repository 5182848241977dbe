#include "drive_odometry.hpp"

#include <cmath>

#include "vestibule/core/errors.hpp"

namespace vestibule::pipeline {
namespace {

constexpr double kMaxCarry_s = 0.5;      // a scan this far from the last message is carried to
constexpr std::size_t kLookedAt = 3000;  // records, for an IMU

}  // namespace

DriveOdometry::DriveOdometry(const Config& config, bool with_gyro) {
  if (with_gyro) filter_.emplace(config.ekf, config.rig);
}

void DriveOdometry::process(const WheelOdometry& wheels) {
  any_ = true;
  if (filter_) {
    filter_->process(wheels);
    return;
  }
  T_odom_base_ = compose(T_odom_base_, wheels.T_previous_now);
  stamp_ = wheels.stamp;
  twist_ = Eigen::Vector3d::Zero();
  if (wheels.dt_s > 0.0) twist_ = logSe2(wheels.T_previous_now) / wheels.dt_s;
}

void DriveOdometry::process(const Imu& imu) {
  if (filter_) filter_->process(imu);
}

Pose2 DriveOdometry::at(Timestamp stamp) const {
  if (filter_) return filter_->odometryAt(std::max(stamp, filter_->time()));
  const double dt_s = toSeconds(stamp - stamp_);
  if (!any_ || std::abs(dt_s) > kMaxCarry_s) return T_odom_base_;
  return compose(T_odom_base_, expSe2(dt_s * twist_));
}

double DriveOdometry::speed() const { return filter_ ? filter_->speed() : twist_.x(); }
double DriveOdometry::yawRate() const { return filter_ ? filter_->yawRate() : twist_.z(); }

bool hasGyro(const std::string& path, const io::RecordingOptions& options) {
  const auto reader = io::openRecording(path, options);
  try {
    for (std::size_t i = 0; i < kLookedAt; ++i) {
      const auto record = reader->next();
      if (!record) return false;
      if (std::holds_alternative<Imu>(record->measurement)) return true;
    }
  } catch (const InputError&) {
    // A damaged recording is reported by whoever reads it for good, with what came before.
  }
  return false;
}

}  // namespace vestibule::pipeline
