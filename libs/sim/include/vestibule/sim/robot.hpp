#pragma once

#include <cstdint>
#include <deque>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/sim/ground.hpp"

namespace vestibule::sim {

enum class DriveType {
  kSkidSteer,     ///< left and right wheels; the treads slide about ICRs of their own
  kDifferential,  ///< left and right wheels that roll without sliding, on the nominal track
  kAckermann      ///< driven rear axle at the base, steered front wheels
};

/// A ground robot. Its motor controller turns (v, omega) into wheel speeds with the nominal
/// geometry, and its odometry turns encoder ticks back the same way; the ground obeys the true one.
struct RobotParams {
  DriveType drive = DriveType::kSkidSteer;
  double nominal_track_m = 0.75;  ///< what the controller and the odometry believe
  double wheelbase_m = 0.55;      ///< between front and rear wheels
  double icr_left_m = 0.42;       ///< [m] y of the left tread's ICR in base, > 0
  double icr_right_m = -0.41;     ///< [m] y of the right tread's ICR in base, < 0
  double icr_x_m = 0.02;          ///< [m] x of the vehicle ICR: v_y = -omega * icr_x
  double grip_left = 0.975;       ///< true tread speed / wheel speed
  double grip_right = 0.98;
  double slip_sigma = 0.01;         ///< of the grip, slowly varying, per side
  double slip_tau_s = 2.0;          ///< its correlation time
  double side_slip = 0.05;          ///< [m/s per rad/s] lateral speed noise while turning
  double burst_rate_hz = 0.02;      ///< slip bursts per second of driving
  double burst_grip = 0.7;          ///< mean grip of the slipping side(s) during a burst
  double burst_duration_s = 0.5;    ///< mean
  double slope_side_slip = 0.3;     ///< sideways speed / (speed * roll [rad]), downhill
  double slope_slip = 0.2;          ///< share of the speed lost per rad of climb
  double wheel_lag_s = 0.15;        ///< first-order wheel speed loop
  double dead_band_mps = 0.01;      ///< a wheel told less than this stands still
  double command_latency_s = 0.02;  ///< from the command to the motor controller
  double max_v_mps = 1.0;
  double max_omega_radps = 2.0;
  double max_accel_mps2 = 1.0;
  double max_alpha_radps2 = 2.5;
  double max_steering_rad = degToRad(35.0);    ///< Ackermann
  double max_steering_radps = degToRad(60.0);  ///< Ackermann
  double steering_offset_rad = 0.0;            ///< Ackermann: true angle when told straight ahead
};
void describe(ParamIo& io, RobotParams& params);

/// True motion of the base under commands. Randomness comes from streams named by the seed and the
/// step number only, so that no sensor setting can change the drive.
class GroundRobot {
 public:
  GroundRobot(const RobotParams& params, const Pose2& T_map_base, std::uint64_t seed);

  /// Reaches the motor controller after the command latency.
  void command(double v_mps, double omega_radps);
  /// Scales the grip of both sides for a while, on top of the random slip.
  void forceSlip(double left, double right, Duration duration);
  /// Advances wheels and ground motion by one step; the pose only moves when `setPose` says so.
  /// \param roll_rad, pitch_rad  attitude on the ground (REP-103: nose down is positive pitch)
  /// \return the true displacement of the step in the plane of the wheels, base at the end seen
  /// from base at the start
  [[nodiscard]] Pose2 advance(
      Duration dt, const GroundClass& ground = {}, double roll_rad = 0.0, double pitch_rad = 0.0);
  void setPose(const Pose2& T_map_base) { T_map_base_ = T_map_base; }

  [[nodiscard]] const Pose2& pose() const { return T_map_base_; }
  [[nodiscard]] double leftTravel() const { return left_travel_m_; }  ///< [m] at the wheel rim
  [[nodiscard]] double rightTravel() const { return right_travel_m_; }
  [[nodiscard]] double steering() const { return steering_rad_; }  ///< as the encoder reads it
  [[nodiscard]] const RobotParams& params() const { return params_; }

 private:
  struct Slip {
    double left = 0.0;
    double right = 0.0;
    double side = 0.0;
  };
  struct Command {
    double v_mps = 0.0;
    double omega_radps = 0.0;
    Duration due{0};
  };
  Slip slipNow(double dt_s, const GroundClass& ground);

  RobotParams params_;
  Pose2 T_map_base_;
  std::uint64_t seed_;
  std::uint64_t step_ = 0;
  Duration now_{0};
  std::deque<Command> commands_;  // on their way
  double v_command_ = 0.0;
  double omega_command_ = 0.0;
  double v_limited_ = 0.0;  // after the acceleration limits
  double omega_limited_ = 0.0;
  double left_mps_ = 0.0;
  double right_mps_ = 0.0;
  double steering_rad_ = 0.0;
  double left_travel_m_ = 0.0;
  double right_travel_m_ = 0.0;
  Slip slow_;  // unit-variance processes
  double burst_remaining_s_ = 0.0;
  double burst_left_grip_ = 1.0;
  double burst_right_grip_ = 1.0;
  Duration forced_until_{0};
  double forced_left_ = 1.0;
  double forced_right_ = 1.0;
};

}  // namespace vestibule::sim
