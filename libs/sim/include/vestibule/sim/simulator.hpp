#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "vestibule/core/params.hpp"
#include "vestibule/sensors/measurements.hpp"
#include "vestibule/sensors/rig.hpp"
#include "vestibule/sim/compass.hpp"
#include "vestibule/sim/gnss.hpp"
#include "vestibule/sim/imu.hpp"
#include "vestibule/sim/lidar.hpp"
#include "vestibule/sim/robot.hpp"
#include "vestibule/sim/sensor_rate.hpp"
#include "vestibule/sim/transport.hpp"
#include "vestibule/sim/wheels.hpp"
#include "vestibule/sim/world.hpp"
#include "vestibule/sim/world_geometry.hpp"

namespace vestibule::sim {

struct Footprint {
  double half_length_m = 0.495;
  double half_width_m = 0.335;
};

struct SimParams {
  RobotParams robot;
  Footprint footprint;
  SensorRig rig{Pose2{0.35, 0.0, 0.0}, Point2{-0.2, 0.1}};  ///< IMU data come in base axes
  WheelParams wheels;
  ImuParams imu;
  LidarParams lidar;
  RingLidarParams ring_lidar;
  GnssParams gnss;
  CompassParams compass;
  TransportParams transport;
  double suspension_hz = 4.0;  ///< how fast the body follows the ground under the wheels
};
void describe(ParamIo& io, SimParams& params);

/// Stamp of the moment before the first step.
inline constexpr Timestamp kStartOfTime{1'700'000'000'000'000'000};

/// A robot in a world: takes commands, gives measurements. Same world, parameters, start, seed and
/// commands give the same bytes. Each sensor draws from streams of its own. Simulators share
/// nothing: several may run in different threads.
class Simulator {
 public:
  Simulator(
      const World& world, const SimParams& params, const Pose2& T_map_base, std::uint64_t seed);

  /// Holds until the next command.
  void command(double v_mps, double omega_radps) { robot_.command(v_mps, omega_radps); }

  /// Advances the truth and returns what reached the computer in (time, time + dt], by arrival; at
  /// equal arrivals wheels, IMU, compass, GNSS, lidar.
  /// \pre dt is a positive multiple of kTruthStep
  [[nodiscard]] std::vector<Delivered> step(Duration dt);

  /// The sweeps of the ring lidar since the last call, by stamp.
  [[nodiscard]] std::vector<LidarSweep> takeSweeps();

  // --- incidents -------------------------------------------------------------------------------
  /// Carries the robot elsewhere; its wheels and gyro notice nothing.
  void carryTo(const Pose2& T_map_base);
  void forceSlip(double left, double right, Duration duration) {
    robot_.forceSlip(left, right, duration);
  }
  void stepGyroBias(double about_z_radps) { imu_.stepGyroBias(about_z_radps); }
  void disturbGnss(const Eigen::Vector3d& offset_enu_m, bool blocked) {
    gnss_.disturb(offset_enu_m, blocked);
  }

  // --- truth -----------------------------------------------------------------------------------
  [[nodiscard]] Timestamp time() const { return time_; }
  [[nodiscard]] const Pose2& truth() const { return robot_.pose(); }  ///< T_map_base
  /// With height [m] and attitude on the ground.
  [[nodiscard]] const Pose3& truth3() const { return history_.back(); }
  /// True body speed over the last truth step: x, y [m/s], yaw [rad/s].
  [[nodiscard]] const Eigen::Vector3d& trueTwist() const { return twist_base_; }
  [[nodiscard]] const Eigen::Vector3d& gyroBias() const { return imu_.gyroBias(); }
  [[nodiscard]] const GnssTruth& gnssTruth() const { return gnss_.truth(); }
  /// Whether the footprint has ever run into something. The robot stays where it was before the
  /// contact while its wheels turn on.
  [[nodiscard]] bool collided() const { return collided_; }
  /// Smallest distance so far between footprint and world [m]; 0 after a collision.
  [[nodiscard]] double minClearance() const { return min_clearance_m_; }
  [[nodiscard]] double distanceDriven() const { return distance_m_; }  ///< [m]
  [[nodiscard]] const WorldGeometry& geometry() const { return *geometry_; }
  [[nodiscard]] const SimParams& params() const { return params_; }

 private:
  void advanceTruth();
  [[nodiscard]] Pose3 onTheGround(const Pose2& T_map_base) const;
  void settle(double dt_s);
  void measureImu();
  /// True pose a share of the way from `span` ago to now.
  [[nodiscard]] Pose3 during(double span_s, double share) const;

  SimParams params_;
  std::unique_ptr<const WorldGeometry> geometry_;  // does not move when the simulator does
  std::uint64_t seed_;
  GroundRobot robot_;
  WheelModel wheels_;
  ImuModel imu_;
  GnssModel gnss_;
  CompassModel compass_;
  Transport transport_;
  bool level_;  // neither slopes nor roughness anywhere
  Moment moment_;
  Timestamp time_ = kStartOfTime;
  std::uint64_t steps_ = 0;
  std::uint64_t scans_ = 0;
  std::uint64_t sweeps_made_ = 0;
  std::vector<LidarSweep> sweeps_;
  std::deque<Pose3> history_;                                 // one per truth step, the newest last
  Eigen::Vector3d attitude_speed_ = Eigen::Vector3d::Zero();  // of z, roll, pitch
  Eigen::Vector3d twist_base_ = Eigen::Vector3d::Zero();
  // at the last IMU message
  Eigen::Matrix3d imu_R_map_base_;
  Eigen::Vector3d imu_velocity_map_ = Eigen::Vector3d::Zero();
  double min_clearance_m_;
  double distance_m_ = 0.0;
  bool collided_ = false;
};

}  // namespace vestibule::sim
