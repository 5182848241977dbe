#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "vestibule/core/params.hpp"
#include "vestibule/sensors/measurements.hpp"
#include "vestibule/sensors/rig.hpp"
#include "vestibule/sim/robot.hpp"
#include "vestibule/sim/sensor_models.hpp"
#include "vestibule/sim/world.hpp"
#include "vestibule/sim/world_geometry.hpp"

namespace vestibule::sim {

struct Footprint {
  double half_length_m = 0.495;
  double half_width_m = 0.335;
};

struct SimParams {
  SkidSteerParams robot;
  Footprint footprint;
  SensorRig rig{Pose2{0.35, 0.0, 0.0}, Point2{-0.2, 0.1}};  ///< IMU data come in base axes
  WheelParams wheels;
  ImuParams imu;
  LidarParams lidar;
  GnssParams gnss;
};
void describe(ParamIo& io, SimParams& params);

/// The truth moves in these steps.
inline constexpr Duration kTruthStep = std::chrono::milliseconds(5);
/// Stamp of the moment before the first step.
inline constexpr Timestamp kStartOfTime{1'700'000'000'000'000'000};

/// A robot in a world: takes commands, gives measurements. Same world, parameters, start, seed and
/// commands give the same bytes. Each sensor draws from streams of its own.
class Simulator {
 public:
  Simulator(
      const World& world, const SimParams& params, const Pose2& T_map_base, std::uint64_t seed);

  /// Holds until the next command.
  void command(double v_mps, double omega_radps) { robot_.command(v_mps, omega_radps); }

  /// Advances the truth and returns what the sensors measured in (time, time + dt], by stamp; at
  /// equal stamps wheels, IMU, GNSS, lidar.
  /// \pre dt is a positive multiple of kTruthStep
  [[nodiscard]] std::vector<Measurement> step(Duration dt);

  [[nodiscard]] Timestamp time() const { return time_; }
  [[nodiscard]] const Pose2& truth() const { return robot_.pose(); }  ///< T_map_base
  /// True body speed over the last truth step: x, y [m/s], yaw [rad/s].
  [[nodiscard]] const Eigen::Vector3d& trueTwist() const { return twist_base_; }
  /// Whether the footprint has ever run into something. The robot stays where it was before the
  /// contact while its wheels turn on.
  [[nodiscard]] bool collided() const { return collided_; }
  /// Smallest distance so far between footprint and world [m]; 0 after a collision.
  [[nodiscard]] double minClearance() const { return min_clearance_m_; }
  [[nodiscard]] double distanceDriven() const { return distance_m_; }  ///< [m]
  [[nodiscard]] const WorldGeometry& geometry() const { return geometry_; }
  [[nodiscard]] const SimParams& params() const { return params_; }

 private:
  void advanceTruth();

  SimParams params_;
  WorldGeometry geometry_;
  std::uint64_t seed_;
  SkidSteerRobot robot_;
  WheelModel wheels_;
  ImuModel imu_;
  GnssModel gnss_;
  Timestamp time_ = kStartOfTime;
  std::uint64_t steps_ = 0;
  std::uint64_t scans_ = 0;
  Eigen::Vector3d twist_base_ = Eigen::Vector3d::Zero();
  // since the last IMU message
  double imu_turn_rad_ = 0.0;
  Eigen::Vector2d imu_velocity_base_ = Eigen::Vector2d::Zero();
  double min_clearance_m_;
  double distance_m_ = 0.0;
  bool collided_ = false;
};

}  // namespace vestibule::sim
