#include "vestibule/mode_manager/params.hpp"

namespace vestibule::mode_manager {

void describe(ParamIo& io, SlewParams& p) {
  io.optional("time_constant_s", p.time_constant_s, positive());
  io.optional("max_mps", p.max_mps, positive());
  io.optionalDegrees("max_degps", p.max_radps, positive());
  io.optional("warn_beyond_m", p.warn_beyond_m, positive());
}

void describe(ParamIo& io, ZoneParams& p) {
  io.optional("seed_within_m", p.seed_within_m);
  io.optional("enter_within_m", p.enter_within_m);
  io.optional("leave_beyond_m", p.leave_beyond_m);
  if (!(p.enter_within_m <= p.leave_beyond_m && p.leave_beyond_m <= p.seed_within_m)) {
    io.problem("", "needs enter_within_m <= leave_beyond_m <= seed_within_m");
  }
}

void describe(ParamIo& io, EvidenceParams& p) {
  io.optional("enter_trust", p.enter_trust, within(0.0, 1.0));
  io.optional("keep_trust", p.keep_trust, within(0.0, 1.0));
  io.optional("max_particle_sigma_m", p.max_particle_sigma_m, positive());
  io.optional("max_particle_age_s", p.max_particle_age_s, positive());
  io.optional("max_fix_age_s", p.max_fix_age_s, positive());
  io.optional("max_gnss_sigma_m", p.max_gnss_sigma_m, positive());
  io.optional("gnss_bias_sigma_m", p.gnss_bias_sigma_m, nonNegative());
  io.optional("agree_probability", p.agree_probability, inside(0.0, 1.0));
  if (p.keep_trust > p.enter_trust) io.problem("keep_trust", "must not exceed enter_trust");
}

void describe(ParamIo& io, HysteresisParams& p) {
  io.optional("enter_hold_s", p.enter_hold_s, nonNegative());
  io.optional("leave_hold_s", p.leave_hold_s, nonNegative());
  io.optional("loss_hold_s", p.loss_hold_s, nonNegative());
  io.optional("seed_interval_s", p.seed_interval_s, positive());
  io.optional("lost_after_m", p.lost_after_m, positive());
}

void describe(ParamIo& io, ModeManagerParams& p) {
  io.section("slew", p.slew);
  io.section("zones", p.zones);
  io.section("evidence", p.evidence);
  io.section("hysteresis", p.hysteresis);
}

}  // namespace vestibule::mode_manager
