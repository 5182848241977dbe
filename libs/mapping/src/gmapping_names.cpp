#include "vestibule/mapping/gmapping_names.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::mapping {

void describe(ParamIo& io, GmappingNames& n) {
  io.optional("particles", n.particles, within(1, 10000));
  io.optional("linearUpdate", n.linearUpdate, positive());
  io.optional("angularUpdate", n.angularUpdate, positive());
  io.optional("temporalUpdate", n.temporalUpdate);
  io.optional("resampleThreshold", n.resampleThreshold, within(0.0, 1.0));
  io.optional("srr", n.srr, nonNegative());
  io.optional("srt", n.srt, nonNegative());
  io.optional("str", n.str, nonNegative());
  io.optional("stt", n.stt, nonNegative());
  io.optional("sigma", n.sigma, positive());
  io.optional("lsigma", n.lsigma, positive());
  io.optional("ogain", n.ogain, positive());
  io.optional("lskip", n.lskip, nonNegative());
  io.optional("minimumScore", n.minimumScore, nonNegative());
  io.optional("iterations", n.iterations, within(1, 100));
  io.optional("maxUrange", n.maxUrange, positive());
  io.optional("maxRange", n.maxRange, positive());
  io.optional("delta", n.delta, Bounds{0.005, 1.0});
  io.optional("occ_thresh", n.occ_thresh, inside(0.0, 1.0));
  io.optional("kernelSize", n.kernelSize);
  io.optional("lstep", n.lstep);
  io.optional("astep", n.astep);
  io.optional("llsamplerange", n.llsamplerange);
  io.optional("llsamplestep", n.llsamplestep);
  io.optional("lasamplerange", n.lasamplerange);
  io.optional("lasamplestep", n.lasamplestep);
  io.optional("xmin", n.xmin);
  io.optional("ymin", n.ymin);
  io.optional("xmax", n.xmax);
  io.optional("ymax", n.ymax);
  io.optional("throttle_scans", n.throttle_scans);
  io.optional("map_update_interval", n.map_update_interval);
  io.optional("transform_publish_period", n.transform_publish_period);
  io.optional("tf_delay", n.tf_delay);
}

void GmappingNames::applyTo(FilterParams& p) const {
  const auto count = [](double value) { return static_cast<int>(std::lround(value)); };
  if (particles) p.particles = count(*particles);
  if (linearUpdate) p.update_d_m = *linearUpdate;
  if (angularUpdate) p.update_a_rad = *angularUpdate;
  // GMapping's -1 means: never because of time alone.
  if (temporalUpdate) p.update_max_s = *temporalUpdate > 0.0 ? *temporalUpdate : 0.0;
  if (resampleThreshold) p.resample_below = *resampleThreshold;
  if (srr) p.odometry.trans_per_trans = *srr;
  if (srt) p.odometry.rot_per_trans = *srt;
  if (str) p.odometry.trans_per_rot = *str;
  if (stt) p.odometry.rot_per_rot = *stt;
  // GMapping has one sigma for the match and one for the weight; ours is both.
  if (sigma) p.matcher.sigma_m = *sigma;
  if (lsigma) p.matcher.sigma_m = *lsigma;
  // GMapping divides the log-likelihood of all beams by ogain * particles.
  if (ogain) {
    p.weight_power =
        std::min(1.0, p.matcher.max_beams / (*ogain * p.particles * p.matcher.effective_beams));
  }
  if (lskip) {
    p.matcher.max_beams = std::max(10, count(p.matcher.max_beams / (1.0 + std::floor(*lskip))));
  }
  if (minimumScore)
    p.matcher.poor_share = std::clamp(*minimumScore / p.matcher.max_beams, 0.0, 1.0);
  if (iterations) p.matcher.iterations = std::max(p.matcher.iterations, count(*iterations));
  if (maxUrange) p.map.max_range_m = *maxUrange;
  if (maxRange) p.matcher.max_range_m = *maxRange;
  if (delta) p.map.resolution_m = *delta;
  if (occ_thresh) p.map.occupied_ratio = *occ_thresh;
}

std::vector<std::string> GmappingNames::withoutEffect() const {
  std::vector<std::string> names;
  const auto note = [&](const std::optional<double>& value, const char* name) {
    if (value) names.emplace_back(name);
  };
  note(kernelSize, "kernelSize");
  note(lstep, "lstep");
  note(astep, "astep");
  note(llsamplerange, "llsamplerange");
  note(llsamplestep, "llsamplestep");
  note(lasamplerange, "lasamplerange");
  note(lasamplestep, "lasamplestep");
  note(xmin, "xmin");
  note(ymin, "ymin");
  note(xmax, "xmax");
  note(ymax, "ymax");
  note(throttle_scans, "throttle_scans");
  note(map_update_interval, "map_update_interval");
  note(transform_publish_period, "transform_publish_period");
  note(tf_delay, "tf_delay");
  return names;
}

}  // namespace vestibule::mapping
