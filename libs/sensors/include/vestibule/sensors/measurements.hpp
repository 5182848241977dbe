#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <variant>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"

namespace vestibule {

/// Logs, the simulator and live drivers all speak in these structs: SI units, radians, ENU, robot
/// axes x forward / y left / z up. `stamp` is when the measurement was true.

/// Wheel odometry as an increment, never as an absolute pose: what the wheels say the base moved
/// during the `dt_s` before `stamp`.
struct WheelOdometry {
  Timestamp stamp;
  double dt_s = 0.0;     ///< [s] >= 0; 0 when the recording gives no usable interval
  Pose2 T_previous_now;  ///< base pose at `stamp` in the base frame of the previous message
  /// The recording gives the reading no stamp of its own: it got that of the scan beside it, and
  /// was taken some time before.
  bool stamp_borrowed = false;
};

struct Imu {
  Timestamp stamp;
  Eigen::Vector3d omega_radps = Eigen::Vector3d::Zero();  ///< body rates in base axes
  Eigen::Vector3d accel_mps2 = Eigen::Vector3d::Zero();   ///< specific force in base axes
};

/// Roll and pitch of the base; pitch is positive with the nose down (REP-103).
struct Tilt {
  double roll_rad = 0.0;
  double pitch_rad = 0.0;
};

/// Absolute heading: IMU orientation, compass, dual antenna.
struct Heading {
  Timestamp stamp;
  double yaw_rad = 0.0;             ///< ENU: counter-clockwise from east
  std::optional<double> sigma_rad;  ///< as reported; empty = unknown
  std::optional<Tilt> tilt;         ///< of sensors that give a whole attitude
  /// One sigma of the constant error that its calibration leaves; empty = not calibrated.
  std::optional<double> offset_sigma_rad = std::nullopt;
};

enum class GnssFixType { kNone, kUnknown, kSingle, kDifferential, kRtkFloat, kRtkFixed };
[[nodiscard]] std::string_view toString(GnssFixType type);

/// Position in a recording's own local metres, turned to ENU.
struct LocalPosition {
  double east_m = 0.0;
  double north_m = 0.0;
  double up_m = 0.0;
};

/// Velocity of the antenna by Doppler or carrier phase, which does not come from its positions.
struct GnssVelocity {
  Eigen::Vector3d enu_mps = Eigen::Vector3d::Zero();  ///< up: NaN = not measured
  std::optional<double> sigma_mps;                    ///< per axis, as reported; empty = unknown
};

/// One fix of the antenna phase centre.
struct GnssFix {
  Timestamp stamp;
  GnssFixType type = GnssFixType::kUnknown;
  std::variant<Geodetic, LocalPosition> position;
  /// ENU covariance [m^2] as the receiver reports it. Empty = unknown, which is not zero.
  std::optional<Eigen::Matrix3d> cov_enu;
  std::optional<double> hdop;
  std::optional<int> satellites;
  std::optional<GnssVelocity> velocity = std::nullopt;
};

/// One sweep of a planar lidar. Beam i points at angle_min_rad + i * angle_step_rad in the laser
/// frame; the frame's pose on the robot is T_base_laser.
struct LaserScan {
  Timestamp stamp;
  double angle_min_rad = 0.0;
  double angle_step_rad = 0.0;
  double time_increment_s = 0.0;  ///< beam i was measured at stamp + i * this; 0 = all at once
  double range_min_m = 0.0;
  double range_max_m = 0.0;     ///< a range at or beyond this is "no echo"
  std::vector<float> ranges_m;  ///< NaN or infinite = no echo
  Pose2 T_base_laser;
  /// Robot pose written beside the scan by the recorder: odometry in a raw log, the corrected pose
  /// in a corrected one. Frame as in the recording.
  std::optional<Pose2> T_log_base;

  [[nodiscard]] bool valid(std::size_t i) const {
    const auto r = static_cast<double>(ranges_m[i]);
    return r >= range_min_m && r > 0.0 && r < range_max_m;  // false for NaN
  }
  [[nodiscard]] double angle(std::size_t i) const {
    return angle_min_rad + static_cast<double>(i) * angle_step_rad;
  }
};

/// One turn of a lidar with several rings. Not a Measurement: no estimator takes it yet.
struct LidarSweep {
  struct Point {
    Eigen::Vector3f p_laser;     ///< [m], axes of the sensor at the stamp of the point
    float time_offset_s = 0.0F;  ///< after the sweep's stamp
    int ring = 0;                ///< from the lowest
  };
  Timestamp stamp;  ///< of the first point
  Pose3 T_base_laser;
  std::vector<Point> points;  ///< only beams with an echo, by time, then ring
};

using Measurement = std::variant<WheelOdometry, Imu, Heading, GnssFix, LaserScan>;
[[nodiscard]] Timestamp stampOf(const Measurement& measurement);

/// End points of the valid beams in the base frame, in beam order.
[[nodiscard]] std::vector<Point2> endPointsInBase(const LaserScan& scan);

}  // namespace vestibule
