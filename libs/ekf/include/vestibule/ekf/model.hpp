#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "vestibule/ekf/state.hpp"

namespace vestibule::ekf {

/// What moved the robot during a step, and how sure that is. Wheels carry the position; where they
/// are silent and the robot has an accelerometer, it coasts on its velocity (in space only).
struct Motion {
  double dt_s = 0.0;
  bool rolling = true;  ///< forward_m, left_m and speed_mps say where it went; else it coasts

  double forward_m = 0.0;  ///< chord of the wheels' motion, along the mean heading of the step
  double left_m = 0.0;
  double speed_mps = 0.0;  ///< by the wheels, forward, at the end of the step
  double left_mps = 0.0;
  Eigen::Vector3d turn_rad = Eigen::Vector3d::Zero();  ///< base axes; gyro: bias included
  bool turn_is_gyro = false;

  Eigen::Vector3d force_mps2 = Eigen::Vector3d::Zero();  ///< coasting: specific force, base axes

  double forward_var = 0.0;  ///< [m^2]
  double left_var = 0.0;     ///< [m^2]
  double up_var = 0.0;       ///< [m^2]
  double turn_var = 0.0;     ///< [rad^2] about the vertical
  double tilt_var = 0.0;     ///< [rad^2] about either horizontal axis
  double speed_var = 0.0;    ///< [m^2/s^2] of the velocity at the end; coasting: gained

  double gyro_bias_var = 0.0;    ///< [rad^2/s^2] growth during the step, and so on
  double accel_bias_var = 0.0;   ///< [m^2/s^4]
  double wheel_scale_var = 0.0;  ///< [-]
  double wheel_skew_var = 0.0;   ///< [rad^2/m^2]
  double track_var = 0.0;        ///< [-]
  double icr_var = 0.0;          ///< [m^2]
  double gnss_bias_decay = 1.0;  ///< [-] share of the slow GNSS error that is left
  double gnss_bias_var = 0.0;    ///< [m^2] per axis
  double heading_offset_decay = 1.0;
  double heading_offset_var = 0.0;  ///< [rad^2]
  double disturbance_decay = 1.0;   ///< [-]
  double disturbance_var = 0.0;     ///< [rad^2]

  /// Whether `next` goes on in the same way, so that both are one step to the covariance.
  [[nodiscard]] bool continuedBy(const Motion& next) const {
    return rolling && next.rolling && turn_is_gyro == next.turn_is_gyro;
  }
  /// As one step: what moves adds up, what is known at the end is that of `next`. The course
  /// between is taken as straight, which a linearisation does not see over a tenth of a second.
  /// \pre continuedBy(next)
  void append(const Motion& next);
};

/// A step linearised at the estimate: error' = F error + noise. Position, velocity and attitude
/// depend on other states; every later one on itself alone.
struct Transition {
  static constexpr int kTop = 9;
  static constexpr int kRest = kStateSize - kTop;
  /// F is this diagonal ...
  Eigen::Matrix<double, kStateSize, 1> keep = Eigen::Matrix<double, kStateSize, 1>::Ones();
  /// ... plus this in its first rows.
  Eigen::Matrix<double, kTop, kStateSize> coupling =
      Eigen::Matrix<double, kTop, kStateSize>::Zero();
  Eigen::Matrix<double, kTop, kTop> top_noise = Eigen::Matrix<double, kTop, kTop>::Zero();
  Eigen::Matrix<double, kRest, 1> rest_noise = Eigen::Matrix<double, kRest, 1>::Zero();
  std::uint32_t columns = 0;  ///< bit j set: column j of `coupling` may differ from zero

  [[nodiscard]] StateMatrix F() const;
  [[nodiscard]] StateMatrix Q() const;
};

/// A measurement linearised at the estimate: residual = z - h(x), wrapped; H = dh/d(error).
/// One to three rows.
struct Observation {
  static constexpr int kMaxRows = 3;
  int rows = 0;
  Eigen::Matrix<double, kMaxRows, 1> residual = Eigen::Matrix<double, kMaxRows, 1>::Zero();
  Eigen::Matrix<double, kMaxRows, kStateSize> H =
      Eigen::Matrix<double, kMaxRows, kStateSize>::Zero();
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  std::uint32_t columns = 0;  ///< bit j set: column j of H may differ from zero

  void set(int row, int column, double value) {
    H(row, column) = value;
    columns |= 1U << static_cast<unsigned>(column);
  }
  [[nodiscard]] bool finite() const;
};

/// Position, velocity and attitude of a wheeled robot with the faults of its sensors. Pure
/// functions; knows neither the filter equations nor any library that runs them.
///
/// One model for the space and for the plane: in the plane, roll, pitch, height and what feeds them
/// have no variance and never get any, so their rows and columns stay zero.
class Model {
 public:
  explicit Model(bool planar) : planar_(planar) {}
  [[nodiscard]] bool planar() const { return planar_; }

  struct Predicted {
    State x;
    Transition step;  ///< linearised at the state before
  };
  [[nodiscard]] Predicted predict(const State& x, const Motion& u) const;
  /// The step alone.
  [[nodiscard]] Transition linearised(const State& x, const Motion& u) const;
  /// The state alone.
  [[nodiscard]] State transition(const State& x, const Motion& u) const;
  /// Takes what cannot move in the plane out of a covariance.
  void constrain(StateMatrix& P) const;

  /// GNSS antenna: z = p + R p_base_antenna + slow error. R in map axes; two rows in the plane.
  [[nodiscard]] Observation gnssPosition(
      const State& x,
      const Eigen::Vector3d& p_map_antenna,
      const Eigen::Vector3d& p_base_antenna,
      const Eigen::Matrix3d& R) const;
  /// Velocity of the antenna: z = v + R ((omega - gyro bias) x p_base_antenna). Two rows in the
  /// plane and where the upward velocity is NaN.
  /// \param omega_is_gyro  else it is the turn rate itself
  [[nodiscard]] Observation gnssVelocity(
      const State& x,
      const Eigen::Vector3d& v_map_antenna,
      const Eigen::Vector3d& p_base_antenna,
      const Eigen::Vector3d& omega_radps,
      bool omega_is_gyro,
      double sigma_mps) const;
  /// Heading sensor: z = yaw + offset + disturbance.
  [[nodiscard]] Observation heading(const State& x, double yaw_rad, double sigma_rad) const;
  /// Roll and pitch of an attitude sensor.
  [[nodiscard]] Observation tilt(
      const State& x, double roll_rad, double pitch_rad, double sigma_rad) const;
  /// Accelerometer of a robot whose own acceleration is known: z = R' g + accel_base + bias.
  [[nodiscard]] Observation gravity(
      const State& x,
      const Eigen::Vector3d& force_mps2,
      const Eigen::Vector3d& accel_base_mps2,
      double sigma_mps2) const;
  /// Pose of the base in the plane: z = (x, y, yaw).
  [[nodiscard]] Observation pose(const State& x, const PoseWithCovariance& T_map_base) const;
  /// Gyro of a standing robot: z = bias.
  [[nodiscard]] Observation zeroRate(
      const State& x, const Eigen::Vector3d& omega_radps, double sigma_radps) const;
  /// Wheels roll neither sideways nor upwards: 0 = (R' v)_y + omega icr_x, 0 = (R' v)_z.
  [[nodiscard]] Observation nonHolonomic(
      const State& x, double omega_z_radps, double sigma_left_mps, double sigma_up_mps) const;
  /// Turn claimed by the wheels against the gyro's, over one wheel message:
  /// z = exp(track) (gyro_turn - bias dt - skew forward). Teaches the wheels only: their slip must
  /// not reach the gyro's bias, whose error belongs into sigma_rad.
  [[nodiscard]] Observation wheelTurn(
      const State& x,
      double wheel_turn_rad,
      double gyro_turn_rad,
      double forward_m,
      double dt_s,
      double sigma_rad) const;

 private:
  bool planar_;
};

}  // namespace vestibule::ekf
