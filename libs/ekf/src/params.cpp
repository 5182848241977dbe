#include "vestibule/ekf/params.hpp"

#include <algorithm>
#include <string_view>

namespace vestibule::ekf {
namespace {

/// A list of names out of `known`, none twice.
void describeUse(
    ParamIo& io,
    const char* sensor,
    std::vector<std::string>& names,
    const std::vector<std::string>& known) {
  io.optional(sensor, names);
  std::string all;
  for (const std::string& k : known) all += (all.empty() ? "" : ", ") + k;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (std::find(known.begin(), known.end(), names[i]) == known.end()) {
      io.problem(sensor, "'" + names[i] + "' is not one of: " + all);
    } else if (std::count(names.begin(), names.end(), names[i]) > 1) {
      io.problem(sensor, "'" + names[i] + "' would be fused twice; name it once");
      return;
    }
  }
}

bool contains(const std::vector<std::string>& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

bool UseParams::wheelSpeed() const { return contains(wheels, "speed"); }
bool UseParams::wheelYawRate() const { return contains(wheels, "yaw_rate"); }
bool UseParams::imuYawRate() const { return contains(imu, "yaw_rate"); }
bool UseParams::imuAcceleration() const { return contains(imu, "acceleration"); }
bool UseParams::headingYaw() const { return contains(heading, "yaw"); }
bool UseParams::headingTilt() const { return contains(heading, "tilt"); }
bool UseParams::gnssPosition() const { return contains(gnss, "position"); }
bool UseParams::gnssVelocity() const { return contains(gnss, "velocity"); }

void describe(ParamIo& io, UseParams& p) {
  describeUse(io, "wheels", p.wheels, {"speed", "yaw_rate"});
  describeUse(io, "imu", p.imu, {"yaw_rate", "acceleration"});
  describeUse(io, "heading", p.heading, {"yaw", "tilt"});
  describeUse(io, "gnss", p.gnss, {"position", "velocity"});
  if (!p.wheelSpeed()) {
    io.problem("wheels", "without 'speed' nothing observes how far the robot went");
  }
  if (!p.wheelYawRate() && !p.imuYawRate()) {
    io.problem("imu", "neither the wheels nor the IMU give a 'yaw_rate': nothing observes turns");
  }
}

void describe(ParamIo& io, WheelParams& p) {
  io.optional("distance_sigma_sqrt_m", p.distance_sigma_sqrt_m, positive());
  io.optional("lateral_sigma_sqrt_m", p.lateral_sigma_sqrt_m, positive());
  io.optional("turn_lateral_sigma_m_sqrt_rad", p.turn_lateral_sigma_m_sqrt_rad, nonNegative());
  io.optional("yaw_sigma_per_rad", p.yaw_sigma_per_rad, positive());
  io.optional("yaw_sigma_sqrt_m", p.yaw_sigma_sqrt_m, positive());
  io.optional("scale_sigma", p.scale_sigma, within(1e-6, 0.5));
  io.optional("scale_walk_sqrt_m", p.scale_walk_sqrt_m, nonNegative());
  io.optional("track_sigma", p.track_sigma, nonNegative());
  io.optional("skew_sigma_rad_per_m", p.skew_sigma_rad_per_m, nonNegative());
  io.optional("icr_sigma_m", p.icr_sigma_m, nonNegative());
  io.optional("learn_above_radps", p.learn_above_radps, positive());
  io.optional("max_gap_s", p.max_gap_s, positive());
  io.optional("dropout_speed_sigma_mps", p.dropout_speed_sigma_mps, positive());
}

void describe(ParamIo& io, GyroParams& p) {
  io.optional("noise_rad_sqrt_s", p.noise_rad_sqrt_s, positive());
  io.optional("rest_noise_rad_sqrt_s", p.rest_noise_rad_sqrt_s, positive());
  io.optional("scale_sigma", p.scale_sigma, nonNegative());
  io.optional("bias_sigma_radps", p.bias_sigma_radps, positive());
  io.optional("bias_walk_radps_sqrt_s", p.bias_walk_radps_sqrt_s, nonNegative());
  io.optional("max_gap_s", p.max_gap_s, positive());
}

void describe(ParamIo& io, AccelParams& p) {
  io.optional("noise_mps2_sqrt_hz", p.noise_mps2_sqrt_hz, positive());
  io.optional("tilt_sigma_mps2", p.tilt_sigma_mps2, positive());
  io.optional("bias_sigma_mps2", p.bias_sigma_mps2, positive());
  io.optional("bias_walk_mps2_sqrt_s", p.bias_walk_mps2_sqrt_s, nonNegative());
  io.optional("position_m", p.position_m, 3, 3);
}

void describe(ParamIo& io, HeadingParams& p) {
  io.optionalDegrees("sigma_deg", p.sigma_rad, positive());
  io.optionalDegrees("offset_walk_deg_sqrt_s", p.offset_walk_rad_sqrt_s, nonNegative());
  io.optionalDegrees("offset_sigma_deg", p.offset_sigma_rad, positive());
  io.optionalDegrees("turn_offset_deg_sqrt_rad", p.turn_offset_rad_sqrt_rad, nonNegative());
  io.optional("calibrated_offset_time_s", p.calibrated_offset_time_s, positive());
  io.optionalDegrees("disturbance_sigma_deg", p.disturbance_sigma_rad, nonNegative());
  io.optional("disturbance_time_s", p.disturbance_time_s, positive());
  io.optional("relearn_after_s", p.relearn_after_s, positive());
  io.optional("min_interval_s", p.min_interval_s, nonNegative());
  io.optionalDegrees("tilt_sigma_deg", p.tilt_sigma_rad, positive());
}

void describe(ParamIo& io, GnssParams& p) {
  io.optional("sigma_rtk_fixed_m", p.sigma_rtk_fixed_m, positive());
  io.optional("sigma_rtk_float_m", p.sigma_rtk_float_m, positive());
  io.optional("sigma_differential_m", p.sigma_differential_m, positive());
  io.optional("sigma_single_m", p.sigma_single_m, positive());
  io.optional("uere_m", p.uere_m, nonNegative());
  io.optional("slow_share", p.slow_share, within(0.0, 0.999));
  io.optional("correlation_s", p.correlation_s, positive());
  io.optional("repeat_s", p.repeat_s, nonNegative());
  io.optional("differential_slow_share", p.differential_slow_share, within(0.0, 0.999));
  io.optional("differential_correlation_s", p.differential_correlation_s, positive());
  io.optional("differential_repeat_s", p.differential_repeat_s, nonNegative());
  io.optional("rtk_slow_share", p.rtk_slow_share, within(0.0, 0.999));
  io.optional("rtk_correlation_s", p.rtk_correlation_s, positive());
  io.optional("gap_s", p.gap_s, positive());
  io.optional("max_sigma_m", p.max_sigma_m, positive());
  io.optional("max_speed_mps", p.max_speed_mps, positive());
  io.optional("relearn_after_s", p.relearn_after_s, positive());
  io.optional("drift_window_s", p.drift_window_s, nonNegative());
  io.optional("adapt_time_s", p.adapt_time_s, nonNegative());
  io.optional("adapt_most", p.adapt_most, within(1.0, 100.0));
  io.optional("velocity_sigma_mps", p.velocity_sigma_mps, positive());
  io.optional("velocity_repeat_s", p.velocity_repeat_s, nonNegative());
}

void describe(ParamIo& io, RecoveryParams& p) {
  io.optional("min_fixes", p.min_fixes, within(2, 1000));
  io.optional("min_span_s", p.min_span_s, positive());
  io.optional("min_travel_m", p.min_travel_m, positive());
  io.optional("min_travel_sigmas", p.min_travel_sigmas, nonNegative());
  io.optional("realign_after_s", p.realign_after_s, positive());
}

void describe(ParamIo& io, InitParams& p) {
  io.optionalDegrees("max_yaw_sigma_deg", p.max_yaw_sigma_rad, within(0.1, 60.0));
  io.optional("min_travel_m", p.min_travel_m, positive());
  io.optional("min_fixes", p.min_fixes, within(2, 1000));
  io.optional("trust_heading", p.trust_heading);
}

void describe(ParamIo& io, FilterParams& p) {
  io.optional("engine", p.engine, {{"fixed", EngineKind::kFixed}, {"mrpt", EngineKind::kMrpt}});
  io.optional("plane", p.plane);
  io.optional("history_s", p.history_s, within(0.0, 60.0));
  io.optional("gate_probability", p.gate_probability, inside(0.0, 1.0));
  io.optional("down_weight_probability", p.down_weight_probability, inside(0.0, 1.0));
  io.optional("standstill_s", p.standstill_s, positive());
  io.optional("standstill_speed_mps", p.standstill_speed_mps, positive());
  io.optional("standstill_rate_radps", p.standstill_rate_radps, positive());
  io.section("use", p.use);
  io.section("wheels", p.wheels);
  io.section("gyro", p.gyro);
  io.section("accel", p.accel);
  io.section("heading", p.heading);
  io.section("gnss", p.gnss);
  io.section("recovery", p.recovery);
  io.section("init", p.init);
  if (p.down_weight_probability > p.gate_probability) {
    io.problem("down_weight_probability", "must not exceed gate_probability");
  }
}

}  // namespace vestibule::ekf
