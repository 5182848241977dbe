#include "vestibule/amcl/params.hpp"

namespace vestibule::amcl {

void describe(ParamIo& io, MotionNoise& p) {
  static const std::vector<std::pair<std::string_view, MotionModel>> kModels{
      {"differential", MotionModel::kDifferential},
      {"omni", MotionModel::kOmni},
      {"skid_steer", MotionModel::kSkidSteer}};
  io.optional("model", p.model, kModels);
  io.optional("trans_per_trans", p.trans_per_trans, nonNegative());
  io.optional("trans_per_rot_m_per_rad", p.trans_per_rot, nonNegative());
  io.optional("rot_per_trans_rad_per_m", p.rot_per_trans, nonNegative());
  io.optional("rot_per_rot", p.rot_per_rot, nonNegative());
  io.optional("gyro_rot_per_rot", p.gyro_rot_per_rot, nonNegative());
  io.optional("lateral_per_trans", p.lateral_per_trans, nonNegative());
  io.optional("lateral_per_rot_m_per_rad", p.lateral_per_rot, nonNegative());
  io.optional("icr_x_m", p.icr_x_m);
  io.optional("min_trans_m", p.min_trans_m, positive());
  io.optionalDegrees("min_rot_deg", p.min_rot_rad, positive());
}

void describe(ParamIo& io, LikelihoodField& p) {
  io.optional("sigma_hit_m", p.sigma_hit_m, positive());
  io.optional("z_hit", p.z_hit, inside(0.0, 1.0));
  io.optional("z_rand", p.z_rand, inside(0.0, 1.0));
  io.optional("max_distance_m", p.max_distance_m, positive());
  io.optional("max_range_m", p.max_range_m, positive());
  io.optional("max_beams", p.max_beams, within(8, 2000));
  io.optional("min_spacing_m", p.min_spacing_m, nonNegative());
  io.optional("effective_beams", p.effective_beams, positive());
}

void describe(ParamIo& io, BeamSkipping& p) {
  io.optional("enabled", p.enabled);
  io.optional("distance_m", p.distance_m, positive());
  io.optional("min_share", p.min_share, within(0.0, 1.0));
  io.optional("max_skipped", p.max_skipped, within(0.0, 1.0));
}

void describe(ParamIo& io, RefinementParams& p) {
  io.optional("enabled", p.enabled);
  io.optional("min_sigma_m", p.min_sigma_m, positive());
  io.optional("max_sigma_m", p.max_sigma_m, positive());
  io.optional("clutter", p.clutter, inside(0.0, 1.0));
  io.optional("max_distance_m", p.max_distance_m, positive());
  io.optional("effective_beams", p.effective_beams, positive());
  io.optional("map_sigma_m", p.map_sigma_m, nonNegative());
  io.optionalDegrees("map_sigma_deg", p.map_sigma_rad, nonNegative());
  io.optional("max_beams", p.max_beams, within(8, 5000));
  io.optional("iterations", p.iterations, within(1, 100));
  io.optional("injected_share", p.injected_share, within(0.0, 0.5));
  if (p.min_sigma_m > p.max_sigma_m) io.problem("min_sigma_m", "must not exceed max_sigma_m");
}

void describe(ParamIo& io, Resampling& p) {
  io.optional("below_effective_share", p.below_effective_share, within(0.0, 1.0));
  io.optional("kernel", p.kernel, nonNegative());
  io.optional("min_effective_share", p.min_effective_share, within(0.0, 0.9));
}

void describe(ParamIo& io, GnssTerm& p) {
  io.optional("in_search", p.in_search);
  io.optional("enabled", p.enabled);
  io.optional("min_sigma_m", p.min_sigma_m, positive());
  io.optional("clutter", p.clutter, inside(0.0, 1.0));
}

void describe(ParamIo& io, Kld& p) {
  io.optional("min_particles", p.min_particles, within(50, 1e6));
  io.optional("max_particles", p.max_particles, within(50, 1e6));
  io.optional("epsilon", p.epsilon, inside(0.0, 1.0));
  io.optional("delta", p.delta, inside(0.0, 0.5));
  io.optional("bin_m", p.bin_m, positive());
  io.optionalDegrees("bin_deg", p.bin_rad, positive());
  if (p.min_particles > p.max_particles) {
    io.problem("min_particles", "must not exceed max_particles");
  }
}

void describe(ParamIo& io, RecoveryParams& p) {
  io.optional("after_scans", p.after_scans, within(1, 1e6));
  io.optional("max_blocked_share", p.max_blocked_share, within(0.0, 1.0));
}

void describe(ParamIo& io, AmclParams& p) {
  io.section("motion", p.motion);
  io.section("likelihood_field", p.field);
  io.section("beam_skipping", p.beam_skipping);
  io.section("refinement", p.refinement);
  io.section("resampling", p.resampling);
  io.section("gnss", p.gnss);
  io.section("kld", p.kld);
  io.section("recovery", p.recovery);
  io.section("global", p.global);
  io.optional("update_min_d_m", p.update_min_d_m, nonNegative());
  io.optionalDegrees("update_min_a_deg", p.update_min_a_rad, nonNegative());
  io.optional("update_max_s", p.update_max_s, positive());
  io.optional("inlier_distance_m", p.inlier_distance_m, positive());
  io.optional("lost_inlier_share", p.lost_inlier_share, within(0.0, 1.0));
  io.optional("trust_time_constant_s", p.trust_time_constant_s, positive());
  io.optional("global_particles_per_m2", p.global_particles_per_m2, positive());
  io.optional("global_max_particles", p.global_max_particles, within(100, 1e7));
  io.optional("threads", p.threads, within(1, 256));
}

}  // namespace vestibule::amcl
