#include "vestibule/sim/robot.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/core/random.hpp"

namespace vestibule::sim {
namespace {

constexpr double kStandstill_mps = 2e-3;  // friction stops a wheel that is told to stop

double towards(double value, double target, double max_change) {
  return value + std::clamp(target - value, -max_change, max_change);
}

}  // namespace

void describe(ParamIo& io, RobotParams& params) {
  io.optional(
      "drive",
      params.drive,
      {{"skid_steer", DriveType::kSkidSteer},
       {"differential", DriveType::kDifferential},
       {"ackermann", DriveType::kAckermann}});
  io.optional("nominal_track_m", params.nominal_track_m, positive());
  io.optional("wheelbase_m", params.wheelbase_m, positive());
  io.optional("icr_left_m", params.icr_left_m, positive());
  io.optional("icr_right_m", params.icr_right_m, Bounds{-100.0, 0.0, false, true});
  io.optional("icr_x_m", params.icr_x_m, within(-1.0, 1.0));
  io.optional("grip_left", params.grip_left, within(0.5, 1.5));
  io.optional("grip_right", params.grip_right, within(0.5, 1.5));
  io.optional("slip_sigma", params.slip_sigma, within(0.0, 0.2));
  io.optional("slip_tau_s", params.slip_tau_s, positive());
  io.optional("side_slip", params.side_slip, within(0.0, 1.0));
  io.optional("burst_rate_hz", params.burst_rate_hz, within(0.0, 10.0));
  io.optional("burst_grip", params.burst_grip, within(0.0, 1.0));
  io.optional("burst_duration_s", params.burst_duration_s, positive());
  io.optional("slope_side_slip", params.slope_side_slip, within(0.0, 10.0));
  io.optional("slope_slip", params.slope_slip, within(0.0, 2.0));
  io.optional("wheel_lag_s", params.wheel_lag_s, positive());
  io.optional("dead_band_mps", params.dead_band_mps, nonNegative());
  io.optional("command_latency_s", params.command_latency_s, within(0.0, 5.0));
  io.optional("max_v_mps", params.max_v_mps, positive());
  io.optional("max_omega_radps", params.max_omega_radps, positive());
  io.optional("max_accel_mps2", params.max_accel_mps2, positive());
  io.optional("max_alpha_radps2", params.max_alpha_radps2, positive());
  io.optionalDegrees("max_steering_deg", params.max_steering_rad, inside(0.0, 80.0));
  io.optionalDegrees("max_steering_degps", params.max_steering_radps, positive());
  io.optionalDegrees("steering_offset_deg", params.steering_offset_rad, within(-10.0, 10.0));
}

GroundRobot::GroundRobot(const RobotParams& params, const Pose2& T_map_base, std::uint64_t seed)
    : params_(params), T_map_base_(T_map_base), seed_(seed) {
  RandomStream random(seed_, "slip start");
  slow_ = {random.normal(), random.normal(), random.normal()};
}

void GroundRobot::command(double v_mps, double omega_radps) {
  commands_.push_back(
      {std::clamp(v_mps, -params_.max_v_mps, params_.max_v_mps),
       std::clamp(omega_radps, -params_.max_omega_radps, params_.max_omega_radps),
       now_ + durationFromSeconds(params_.command_latency_s)});
}

void GroundRobot::forceSlip(double left, double right, Duration duration) {
  forced_left_ = left;
  forced_right_ = right;
  forced_until_ = now_ + duration;
}

GroundRobot::Slip GroundRobot::slipNow(double dt_s, const GroundClass& ground) {
  RandomStream random(seed_, "slip", step_);
  const double keep = std::exp(-dt_s / params_.slip_tau_s);
  const double fresh = std::sqrt(1.0 - keep * keep);
  slow_.left = keep * slow_.left + fresh * random.normal();
  slow_.right = keep * slow_.right + fresh * random.normal();
  slow_.side = keep * slow_.side + fresh * random.normal();

  const bool moving = std::abs(left_mps_) + std::abs(right_mps_) > 0.1;
  burst_remaining_s_ -= dt_s;
  if (burst_remaining_s_ <= 0.0) {
    burst_left_grip_ = burst_right_grip_ = 1.0;
    if (moving && random.bernoulli(params_.burst_rate_hz * ground.slip_scale * dt_s)) {
      burst_remaining_s_ = random.exponential(params_.burst_duration_s);
      // The left side, the right side or both, alike often.
      const double which = random.uniform(0.0, 3.0);
      const double grip = std::clamp(random.normal(params_.burst_grip, 0.1), 0.0, 1.0);
      if (which < 2.0) burst_left_grip_ = grip;
      if (which >= 1.0) burst_right_grip_ = grip;
    }
  }
  const double sigma = params_.slip_sigma * ground.slip_scale;
  Slip slip{
      (params_.grip_left * ground.grip_scale + sigma * slow_.left) * burst_left_grip_,
      (params_.grip_right * ground.grip_scale + sigma * slow_.right) * burst_right_grip_,
      params_.side_slip * slow_.side};
  if (now_ < forced_until_) {
    slip.left *= forced_left_;
    slip.right *= forced_right_;
  }
  return slip;
}

Pose2 GroundRobot::advance(
    Duration dt, const GroundClass& ground, double roll_rad, double pitch_rad) {
  const double dt_s = toSeconds(dt);
  const Slip slip = slipNow(dt_s, ground);
  ++step_;
  now_ += dt;
  while (!commands_.empty() && commands_.front().due < now_) {
    v_command_ = commands_.front().v_mps;
    omega_command_ = commands_.front().omega_radps;
    commands_.pop_front();
  }

  v_limited_ = towards(v_limited_, v_command_, params_.max_accel_mps2 * dt_s);
  omega_limited_ = towards(omega_limited_, omega_command_, params_.max_alpha_radps2 * dt_s);
  const double half_track_m = 0.5 * params_.nominal_track_m;
  const double follow = 1.0 - std::exp(-dt_s / params_.wheel_lag_s);
  const auto turn_wheel = [&](double& wheel_mps, double target_mps) {
    if (std::abs(target_mps) < params_.dead_band_mps) target_mps = 0.0;
    wheel_mps += follow * (target_mps - wheel_mps);
    if (target_mps == 0.0 && std::abs(wheel_mps) < kStandstill_mps) wheel_mps = 0.0;
  };
  // Climbing costs grip, and a slope pulls the robot sideways downhill (roll > 0: left side up).
  const double climb = 1.0 - params_.slope_slip * std::abs(pitch_rad);
  const auto downhill = [&](double v_x) {
    return -params_.slope_side_slip * std::abs(v_x) * roll_rad;
  };
  if (params_.drive == DriveType::kAckermann) {
    // omega = v tan(steering) / wheelbase; at standstill the wheels keep their angle.
    const double wanted_rad = std::abs(v_limited_) > 1e-3
                                  ? std::atan(params_.wheelbase_m * omega_limited_ / v_limited_)
                                  : steering_rad_;
    const double told_rad =
        std::clamp(wanted_rad, -params_.max_steering_rad, params_.max_steering_rad);
    steering_rad_ = towards(steering_rad_, told_rad, params_.max_steering_radps * dt_s);
    const double curvature =
        std::tan(steering_rad_ + params_.steering_offset_rad) / params_.wheelbase_m;
    double centre_mps = 0.5 * (left_mps_ + right_mps_);
    turn_wheel(centre_mps, v_limited_);
    left_mps_ = centre_mps * (1.0 - curvature * half_track_m);
    right_mps_ = centre_mps * (1.0 + curvature * half_track_m);
    left_travel_m_ += left_mps_ * dt_s;
    right_travel_m_ += right_mps_ * dt_s;
    const double v_x = 0.5 * (slip.left + slip.right) * centre_mps * climb;
    const double omega = v_x * curvature;
    const double v_y = std::abs(omega) * slip.side + downhill(v_x);
    return expSe2(Eigen::Vector3d(v_x, v_y, omega) * dt_s);
  }
  turn_wheel(left_mps_, v_limited_ - omega_limited_ * half_track_m);
  turn_wheel(right_mps_, v_limited_ + omega_limited_ * half_track_m);
  left_travel_m_ += left_mps_ * dt_s;
  right_travel_m_ += right_mps_ * dt_s;

  // Mandow et al. 2007: each tread moves over the ground about its own instantaneous centre.
  const bool slides = params_.drive == DriveType::kSkidSteer;
  const double icr_left_m = slides ? params_.icr_left_m * ground.icr_scale : half_track_m;
  const double icr_right_m = slides ? params_.icr_right_m * ground.icr_scale : -half_track_m;
  const double icr_x_m = slides ? params_.icr_x_m : 0.0;
  const double left = slip.left * left_mps_ * climb;
  const double right = slip.right * right_mps_ * climb;
  const double width = icr_left_m - icr_right_m;
  const double omega = (right - left) / width;
  const double v_x = (right * icr_left_m - left * icr_right_m) / width;
  const double v_y = -omega * icr_x_m + std::abs(omega) * slip.side + downhill(v_x);
  return expSe2(Eigen::Vector3d(v_x, v_y, omega) * dt_s);
}

}  // namespace vestibule::sim
