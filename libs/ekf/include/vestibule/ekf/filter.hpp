#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "vestibule/core/events.hpp"
#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/ekf/engine.hpp"
#include "vestibule/ekf/params.hpp"
#include "vestibule/sensors/measurements.hpp"
#include "vestibule/sensors/rig.hpp"

namespace vestibule::ekf {

/// What became of a measurement, and the numbers behind it. `nis` is 0 where it was not computed.
struct UpdateReport {
  Decision decision = Decision::kAccepted;
  std::string reason;  ///< "", "chi2", "stale", "not finite", "no fix", "sigma", "not ready",
                       ///< "reset" (position moved to a new cluster), "initialised", "relearn"
  double nis = 0.0;
  double gate = 0.0;
  int dof = 0;
};

/// Measurements that could not be used at all.
struct Dropped {
  std::size_t stale = 0;       ///< older than the filter
  std::size_t not_finite = 0;  ///< NaN, infinity, negative interval or variance
};

/// Dead reckoning on wheels, gyro and changes of the heading sensor: the model without any absolute
/// measurement. Starts at the origin with the first message; its position never jumps, its yaw is
/// turned by the heading sensor only as far as the gyro leaves room for it.
///
/// The yaw rate is taken about the vertical as the accelerometer shows it (specific force, +9.81 on
/// the axis that points up), so an IMU mounted on its side or upside down works unannounced.
/// Without a full accelerometer it is the rate about z.
class OdometryFilter {
 public:
  explicit OdometryFilter(const FilterParams& params);
  OdometryFilter(OdometryFilter&&) noexcept;
  OdometryFilter& operator=(OdometryFilter&&) noexcept;
  ~OdometryFilter();

  void process(const WheelOdometry& wheels);
  void process(const Imu& imu);
  void process(const Heading& heading);

  /// T_odom_base at time(), with the covariance grown since the start.
  [[nodiscard]] PoseWithCovariance pose() const;
  /// The same carried on to `stamp` with the present speed and turn rate; state is unchanged.
  /// \pre stamp >= time(); beyond half a second the pose at half a second
  [[nodiscard]] Pose2 poseAt(Timestamp stamp) const;
  [[nodiscard]] Timestamp time() const;
  [[nodiscard]] double yawRate() const;  ///< [rad/s] bias removed
  [[nodiscard]] double speed() const;    ///< [m/s] forward positive
  [[nodiscard]] bool standstill() const;
  [[nodiscard]] double gyroBias() const;  ///< [rad/s]
  [[nodiscard]] const Dropped& dropped() const;

 private:
  class Core;
  friend class PlanarFilter;
  std::unique_ptr<Core> core_;
};

/// Where the robot is in the map: the model with GNSS (and, indoors, poses from map localization).
/// Not ready until position and yaw are known: by reset(), or by aligning the odometry track with
/// the GNSS track. Owns an odometry filter that runs on the same input from the start.
class PlanarFilter {
 public:
  /// \param observers  may be null; outlives the filter
  PlanarFilter(
      const FilterParams& params, const SensorRig& rig, const Observers* observers = nullptr);
  ~PlanarFilter();

  void process(const WheelOdometry& wheels);
  void process(const Imu& imu);
  UpdateReport process(const Heading& heading);
  /// Raw antenna position: the lever arm is removed here.
  ///
  /// \param p_map_antenna  antenna phase centre in map (ENU) [m]
  /// \param cov            as reported [m^2]; empty, zero or not positive = unknown
  UpdateReport processGnss(
      Timestamp stamp,
      const Eigen::Vector2d& p_map_antenna,
      const std::optional<Eigen::Matrix2d>& cov,
      GnssFixType type,
      std::optional<double> hdop = std::nullopt,
      std::optional<int> satellites = std::nullopt);
  UpdateReport processExternalPose(Timestamp stamp, const PoseWithCovariance& T_map_base);

  /// Starts (again) from a known pose. Keeps gyro bias and wheel scale.
  void reset(Timestamp stamp, const PoseWithCovariance& T_map_base);

  [[nodiscard]] bool ready() const;
  /// What is missing, for people; empty when ready.
  [[nodiscard]] std::string waitingFor() const;
  /// T_map_base at time(). \pre ready()
  [[nodiscard]] PoseWithCovariance pose() const;
  [[nodiscard]] Pose2 poseAt(Timestamp stamp) const;  ///< as OdometryFilter::poseAt
  [[nodiscard]] Timestamp time() const;
  [[nodiscard]] double yawRate() const;
  [[nodiscard]] double speed() const;
  [[nodiscard]] bool standstill() const;
  /// T_map_odom when the filter became ready (odom: the frame of odometry()): places the odometry
  /// poses from before. Empty until ready.
  [[nodiscard]] std::optional<PoseWithCovariance> initialAlignment() const;
  /// Log of true distance per wheel distance, with sigma.
  [[nodiscard]] std::pair<double, double> wheelScale() const;
  [[nodiscard]] const OdometryFilter& odometry() const;
  [[nodiscard]] const Dropped& dropped() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vestibule::ekf
