#include "vestibule/mapping/params.hpp"

#include "vestibule/mapping/mapping_params.hpp"

namespace vestibule::mapping {

void describe(ParamIo& io, FilterMapParams& p) {
  io.optional("resolution_m", p.resolution_m, Bounds{0.005, 1.0});
  io.optional("max_range_m", p.max_range_m, positive());
  io.optional("occupied_ratio", p.occupied_ratio, inside(0.0, 1.0));
  io.optional("max_count", p.max_count, within(2, 65535));
}

void describe(ParamIo& io, OdometryNoise& p) {
  io.optional("trans_per_trans", p.trans_per_trans, nonNegative());
  io.optional("trans_per_rot_m_per_rad", p.trans_per_rot, nonNegative());
  io.optional("rot_per_trans_rad_per_m", p.rot_per_trans, nonNegative());
  io.optional("rot_per_rot", p.rot_per_rot, nonNegative());
  io.optional("min_trans_m", p.min_trans_m, positive());
  io.optionalDegrees("min_rot_deg", p.min_rot_rad, positive());
}

void describe(ParamIo& io, MatcherParams& p) {
  io.optional("max_range_m", p.max_range_m, positive());
  io.optional("max_beams", p.max_beams, within(10, 100000));
  io.optional("min_spacing_m", p.min_spacing_m, nonNegative());
  io.optional("sigma_m", p.sigma_m, positive());
  io.optional("z_rand", p.z_rand, inside(0.0, 1.0));
  io.optional("z_unknown", p.z_unknown, inside(0.0, 1.0));
  io.optional("effective_beams", p.effective_beams, positive());
  io.optional("iterations", p.iterations, within(1, 100));
  io.optional("window_m", p.window_m, within(0.0, 5.0));
  io.optionalDegrees("window_deg", p.window_rad, within(0.0, 180.0));
  io.optional("wide_window_m", p.wide_window_m, within(0.0, 10.0));
  io.optionalDegrees("wide_window_deg", p.wide_window_rad, within(0.0, 180.0));
  io.optional("poor_share", p.poor_share, within(0.0, 1.0));
}

void describe(ParamIo& io, FilterParams& p) {
  io.optional("particles", p.particles, within(1, 10000));
  io.optional("update_d_m", p.update_d_m, positive());
  io.optionalDegrees("update_a_deg", p.update_a_rad, positive());
  io.optional("update_max_s", p.update_max_s, nonNegative());
  io.optional("resample_below", p.resample_below, within(0.0, 1.0));
  io.optional("weight_power", p.weight_power, within(0.0, 1.0));
  io.optional("proposal_spread", p.proposal_spread, nonNegative());
  io.optional("free_range_m", p.free_range_m, positive());
  io.optional("threads", p.threads, within(0, 256));
  io.section("map", p.map);
  io.section("odometry", p.odometry);
  io.section("matcher", p.matcher);
}

void describe(ParamIo& io, MappingParams& p) {
  describe(io, p.known_poses);
  io.section("filter", p.filter);
  io.section("smooth", p.smooth);
  io.section("finish", p.finish);
  io.section("gmapping", p.gmapping);
  if (!io.writing()) p.gmapping.applyTo(p.filter);
}

}  // namespace vestibule::mapping
