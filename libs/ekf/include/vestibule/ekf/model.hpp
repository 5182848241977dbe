#pragma once

#include <Eigen/Core>

#include "vestibule/core/frames.hpp"

namespace vestibule::ekf {

/// Blocks of the state vector. The error is additive in all of them; yaw differences are wrapped.
enum StateIndex : int {
  kX = 0,              ///< [m]   base position in map (or odom), east
  kY = 1,              ///< [m]   north
  kYaw = 2,            ///< [rad] base yaw in map (or odom)
  kGyroBias = 3,       ///< [rad/s] gyro reading at rest
  kWheelScale = 4,     ///< [-]   log of (true distance / wheel distance)
  kHeadingOffset = 5,  ///< [rad] heading sensor reading minus yaw: mounting, declination
  kDisturbance = 6,    ///< [rad] the part of that difference that comes and goes (magnetic)
  kStateSize = 7
};
using State = Eigen::Matrix<double, kStateSize, 1>;
using StateMatrix = Eigen::Matrix<double, kStateSize, kStateSize>;

/// What moved the robot during a step, and how sure that is.
struct Motion {
  double dt_s = 0.0;
  double forward_m = 0.0;  ///< chord of the wheels' motion, along the mean heading of the step
  double left_m = 0.0;
  double turn_rad = 0.0;  ///< gyro: bias included; wheels: as they say
  bool turn_is_gyro = false;
  double forward_var = 0.0;         ///< [m^2]
  double left_var = 0.0;            ///< [m^2]
  double turn_var = 0.0;            ///< [rad^2]
  double gyro_bias_var = 0.0;       ///< [rad^2/s^2] growth during the step
  double wheel_scale_var = 0.0;     ///< [-]
  double heading_offset_var = 0.0;  ///< [rad^2]
  double disturbance_decay = 1.0;   ///< [-] share of the disturbance that is left after the step
  double disturbance_var = 0.0;     ///< [rad^2]
};

/// A measurement linearised at the present state: residual = z - h(x), wrapped; H = dh/dx.
/// One to three rows; the unused ones are not there.
struct Observation {
  using Residual = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 3, 1>;
  using Jacobian = Eigen::Matrix<double, Eigen::Dynamic, kStateSize, 0, 3, kStateSize>;
  using Noise = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;
  Residual residual;
  Jacobian H;
  Noise R;
  [[nodiscard]] int dof() const { return static_cast<int>(residual.size()); }
};

/// Planar unicycle with gyro bias, wheel scale and heading sensor offset. Pure functions; knows
/// neither the filter equations nor any library that runs them.
struct PlanarModel {
  /// f(x, u): position moves along the mean heading of the step.
  [[nodiscard]] static State transition(const State& x, const Motion& u);
  /// df/dx at x.
  [[nodiscard]] static StateMatrix jacobian(const State& x, const Motion& u);
  /// Covariance that the step adds; positive semi-definite.
  [[nodiscard]] static StateMatrix processNoise(const State& x, const Motion& u);

  /// GNSS antenna position: z = p + R(yaw) p_base_antenna.
  [[nodiscard]] static Observation gnss(
      const State& x,
      const Eigen::Vector2d& p_map_antenna,
      const Point2& p_base_antenna,
      const Eigen::Matrix2d& R);
  /// Heading sensor: z = yaw + offset + disturbance.
  [[nodiscard]] static Observation heading(const State& x, double yaw_rad, double sigma_rad);
  /// Pose of the base: z = (x, y, yaw).
  [[nodiscard]] static Observation pose(const State& x, const PoseWithCovariance& T_map_base);
  /// Gyro reading while the robot stands: z = bias.
  [[nodiscard]] static Observation zeroRate(const State& x, double omega_radps, double sigma_radps);
};

}  // namespace vestibule::ekf
