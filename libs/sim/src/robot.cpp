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

void describe(ParamIo& io, SkidSteerParams& params) {
  io.optional("nominal_track_m", params.nominal_track_m, positive());
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
  io.optional("wheel_lag_s", params.wheel_lag_s, positive());
  io.optional("max_v_mps", params.max_v_mps, positive());
  io.optional("max_omega_radps", params.max_omega_radps, positive());
  io.optional("max_accel_mps2", params.max_accel_mps2, positive());
  io.optional("max_alpha_radps2", params.max_alpha_radps2, positive());
}

SkidSteerRobot::SkidSteerRobot(
    const SkidSteerParams& params, const Pose2& T_map_base, std::uint64_t seed)
    : params_(params), T_map_base_(T_map_base), seed_(seed) {
  RandomStream random(seed_, "slip start");
  slow_ = {random.normal(), random.normal(), random.normal()};
}

void SkidSteerRobot::command(double v_mps, double omega_radps) {
  v_command_ = std::clamp(v_mps, -params_.max_v_mps, params_.max_v_mps);
  omega_command_ = std::clamp(omega_radps, -params_.max_omega_radps, params_.max_omega_radps);
}

SkidSteerRobot::Slip SkidSteerRobot::slipNow(double dt_s) {
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
    if (moving && random.bernoulli(params_.burst_rate_hz * dt_s)) {
      burst_remaining_s_ = random.exponential(params_.burst_duration_s);
      // The left side, the right side or both, alike often.
      const double which = random.uniform(0.0, 3.0);
      const double grip = std::clamp(random.normal(params_.burst_grip, 0.1), 0.0, 1.0);
      if (which < 2.0) burst_left_grip_ = grip;
      if (which >= 1.0) burst_right_grip_ = grip;
    }
  }
  return {
      (params_.grip_left + params_.slip_sigma * slow_.left) * burst_left_grip_,
      (params_.grip_right + params_.slip_sigma * slow_.right) * burst_right_grip_,
      params_.side_slip * slow_.side};
}

Pose2 SkidSteerRobot::advance(Duration dt) {
  const double dt_s = toSeconds(dt);
  const Slip slip = slipNow(dt_s);
  ++step_;

  v_limited_ = towards(v_limited_, v_command_, params_.max_accel_mps2 * dt_s);
  omega_limited_ = towards(omega_limited_, omega_command_, params_.max_alpha_radps2 * dt_s);
  const double half_track_m = 0.5 * params_.nominal_track_m;
  const double follow = 1.0 - std::exp(-dt_s / params_.wheel_lag_s);
  const auto turn_wheel = [&](double& wheel_mps, double target_mps) {
    wheel_mps += follow * (target_mps - wheel_mps);
    if (target_mps == 0.0 && std::abs(wheel_mps) < kStandstill_mps) wheel_mps = 0.0;
  };
  turn_wheel(left_mps_, v_limited_ - omega_limited_ * half_track_m);
  turn_wheel(right_mps_, v_limited_ + omega_limited_ * half_track_m);
  left_travel_m_ += left_mps_ * dt_s;
  right_travel_m_ += right_mps_ * dt_s;

  // Mandow et al. 2007: each tread moves over the ground about its own instantaneous centre.
  const double left = slip.left * left_mps_;
  const double right = slip.right * right_mps_;
  const double width = params_.icr_left_m - params_.icr_right_m;
  const double omega = (right - left) / width;
  const double v_x = (right * params_.icr_left_m - left * params_.icr_right_m) / width;
  const double v_y = -omega * params_.icr_x_m + std::abs(omega) * slip.side;
  return expSe2(Eigen::Vector3d(v_x, v_y, omega) * dt_s);
}

}  // namespace vestibule::sim
