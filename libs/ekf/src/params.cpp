#include "vestibule/ekf/params.hpp"

namespace vestibule::ekf {

void describe(ParamIo& io, WheelParams& p) {
  io.optional("distance_sigma_sqrt_m", p.distance_sigma_sqrt_m, positive());
  io.optional("lateral_sigma_sqrt_m", p.lateral_sigma_sqrt_m, positive());
  io.optional("yaw_sigma_per_rad", p.yaw_sigma_per_rad, positive());
  io.optional("yaw_sigma_sqrt_m", p.yaw_sigma_sqrt_m, positive());
  io.optional("scale_sigma", p.scale_sigma, within(1e-6, 0.5));
  io.optional("scale_walk_sqrt_m", p.scale_walk_sqrt_m, nonNegative());
  io.optional("max_gap_s", p.max_gap_s, positive());
  io.optional("dropout_speed_sigma_mps", p.dropout_speed_sigma_mps, positive());
}

void describe(ParamIo& io, GyroParams& p) {
  io.optional("noise_rad_sqrt_s", p.noise_rad_sqrt_s, positive());
  io.optional("scale_sigma", p.scale_sigma, nonNegative());
  io.optional("bias_sigma_radps", p.bias_sigma_radps, positive());
  io.optional("bias_walk_radps_sqrt_s", p.bias_walk_radps_sqrt_s, nonNegative());
  io.optional("max_gap_s", p.max_gap_s, positive());
}

void describe(ParamIo& io, HeadingParams& p) {
  io.optionalDegrees("sigma_deg", p.sigma_rad, positive());
  io.optionalDegrees("offset_walk_deg_sqrt_s", p.offset_walk_rad_sqrt_s, nonNegative());
  io.optionalDegrees("offset_sigma_deg", p.offset_sigma_rad, positive());
  io.optionalDegrees("disturbance_sigma_deg", p.disturbance_sigma_rad, nonNegative());
  io.optional("disturbance_time_s", p.disturbance_time_s, positive());
  io.optional("relearn_after_s", p.relearn_after_s, positive());
}

void describe(ParamIo& io, GnssParams& p) {
  io.optional("sigma_rtk_fixed_m", p.sigma_rtk_fixed_m, positive());
  io.optional("sigma_rtk_float_m", p.sigma_rtk_float_m, positive());
  io.optional("sigma_differential_m", p.sigma_differential_m, positive());
  io.optional("sigma_single_m", p.sigma_single_m, positive());
  io.optional("uere_m", p.uere_m, nonNegative());
  io.optional("correlation_s", p.correlation_s, nonNegative());
  io.optional("rtk_correlation_s", p.rtk_correlation_s, nonNegative());
  io.optional("gap_s", p.gap_s, positive());
  io.optional("max_sigma_m", p.max_sigma_m, positive());
}

void describe(ParamIo& io, RecoveryParams& p) {
  io.optional("min_fixes", p.min_fixes, within(2, 1000));
  io.optional("min_span_s", p.min_span_s, positive());
  io.optional("min_travel_m", p.min_travel_m, positive());
  io.optional("realign_after_s", p.realign_after_s, positive());
}

void describe(ParamIo& io, InitParams& p) {
  io.optionalDegrees("max_yaw_sigma_deg", p.max_yaw_sigma_rad, within(0.1, 60.0));
  io.optional("min_travel_m", p.min_travel_m, positive());
  io.optional("min_fixes", p.min_fixes, within(2, 1000));
  io.optional("trust_heading", p.trust_heading);
}

void describe(ParamIo& io, FilterParams& p) {
  io.optional("gate_probability", p.gate_probability, inside(0.0, 1.0));
  io.optional("down_weight_probability", p.down_weight_probability, inside(0.0, 1.0));
  io.optional("standstill_s", p.standstill_s, positive());
  io.optional("standstill_speed_mps", p.standstill_speed_mps, positive());
  io.optional("standstill_rate_radps", p.standstill_rate_radps, positive());
  io.section("wheels", p.wheels);
  io.section("gyro", p.gyro);
  io.section("heading", p.heading);
  io.section("gnss", p.gnss);
  io.section("recovery", p.recovery);
  io.section("init", p.init);
  if (p.down_weight_probability > p.gate_probability) {
    io.problem("down_weight_probability", "must not exceed gate_probability");
  }
}

}  // namespace vestibule::ekf
