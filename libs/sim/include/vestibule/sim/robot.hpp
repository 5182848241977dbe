#pragma once

#include <cstdint>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/core/time.hpp"

namespace vestibule::sim {

/// Skid-steer base. Its motor controller turns (v, omega) into wheel speeds with the nominal track,
/// and its odometry turns encoder ticks back the same way; the ground obeys the tread ICRs instead.
struct SkidSteerParams {
  double nominal_track_m = 0.75;  ///< what the controller and the odometry believe
  double icr_left_m = 0.42;       ///< [m] y of the left tread's ICR in base, > 0
  double icr_right_m = -0.41;     ///< [m] y of the right tread's ICR in base, < 0
  double icr_x_m = 0.02;          ///< [m] x of the vehicle ICR: v_y = -omega * icr_x
  double grip_left = 0.975;       ///< true tread speed / wheel speed
  double grip_right = 0.98;
  double slip_sigma = 0.01;       ///< of the grip, slowly varying, per side
  double slip_tau_s = 2.0;        ///< its correlation time
  double side_slip = 0.05;        ///< [m/s per rad/s] lateral speed noise while turning
  double burst_rate_hz = 0.02;    ///< slip bursts per second of driving
  double burst_grip = 0.7;        ///< mean grip of the slipping side(s) during a burst
  double burst_duration_s = 0.5;  ///< mean
  double wheel_lag_s = 0.15;      ///< first-order wheel speed loop
  double max_v_mps = 1.0;
  double max_omega_radps = 2.0;
  double max_accel_mps2 = 1.0;
  double max_alpha_radps2 = 2.5;
};
void describe(ParamIo& io, SkidSteerParams& params);

/// True motion of the base under commands. Randomness comes from streams named by the seed and the
/// step number only, so that no sensor setting can change the drive.
class SkidSteerRobot {
 public:
  SkidSteerRobot(const SkidSteerParams& params, const Pose2& T_map_base, std::uint64_t seed);

  void command(double v_mps, double omega_radps);
  /// Advances wheels and ground motion by one step; the pose only moves when `setPose` says so.
  /// \return the true displacement of the step, base at the end seen from base at the start
  [[nodiscard]] Pose2 advance(Duration dt);
  void setPose(const Pose2& T_map_base) { T_map_base_ = T_map_base; }

  [[nodiscard]] const Pose2& pose() const { return T_map_base_; }
  [[nodiscard]] double leftTravel() const { return left_travel_m_; }  ///< [m] at the wheel rim
  [[nodiscard]] double rightTravel() const { return right_travel_m_; }
  [[nodiscard]] const SkidSteerParams& params() const { return params_; }

 private:
  struct Slip {
    double left = 0.0;
    double right = 0.0;
    double side = 0.0;
  };
  Slip slipNow(double dt_s);

  SkidSteerParams params_;
  Pose2 T_map_base_;
  std::uint64_t seed_;
  std::uint64_t step_ = 0;
  double v_command_ = 0.0;
  double omega_command_ = 0.0;
  double v_limited_ = 0.0;  // after the acceleration limits
  double omega_limited_ = 0.0;
  double left_mps_ = 0.0;
  double right_mps_ = 0.0;
  double left_travel_m_ = 0.0;
  double right_travel_m_ = 0.0;
  Slip slow_;  // unit-variance processes
  double burst_remaining_s_ = 0.0;
  double burst_left_grip_ = 1.0;
  double burst_right_grip_ = 1.0;
};

}  // namespace vestibule::sim
