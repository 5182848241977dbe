#include "vestibule/sim/compass.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/sim/place_noise.hpp"
#include "vestibule/sim/sensor_rate.hpp"

namespace vestibule::sim {

void describe(ParamIo& io, CompassParams& params) {
  io.optional("enabled", params.enabled);
  rateField(io, params.rate_hz);
  io.optionalDegrees("sigma_deg", params.sigma_rad, positive());
  io.optionalDegrees("deviation_deg", params.deviation_rad, nonNegative());
  io.optionalDegrees("soft_iron_deg", params.soft_iron_rad, nonNegative());
  io.optionalDegrees("indoor_deg", params.indoor_rad, nonNegative());
  io.optional("indoor_length_m", params.indoor_length_m, positive());
  io.optional("reach_m", params.reach_m, positive());
  io.optionalDegrees("ground_deg", params.ground_rad, nonNegative());
  io.optional("ground_length_m", params.ground_length_m, positive());
}

CompassModel::CompassModel(const CompassParams& params, std::uint64_t seed)
    : params_(params),
      seed_(seed),
      deviation_phase_rad_(RandomStream(seed, "compass start").uniform(0.0, 2.0 * kPi)),
      soft_iron_phase_rad_(RandomStream(seed, "compass soft iron").uniform(0.0, 2.0 * kPi)) {}

Heading CompassModel::measure(Timestamp stamp, const Pose2& T_map_base, double distance_to_roof_m) {
  RandomStream random(seed_, "compass", index_++);
  const auto ofPlace = [&](const char* what, double length_m) {
    return placeNoise(derivedSeed(seed_, what), 0, {T_map_base.x, T_map_base.y}, length_m);
  };
  const double steel = std::exp(-std::max(distance_to_roof_m, 0.0) / params_.reach_m);
  const double disturbance_rad =
      params_.indoor_rad * steel * ofPlace("compass place", params_.indoor_length_m) +
      params_.ground_rad * ofPlace("compass ground", params_.ground_length_m);
  const double own_iron_rad =
      params_.deviation_rad * std::sin(T_map_base.phi + deviation_phase_rad_) +
      params_.soft_iron_rad * std::sin(2.0 * T_map_base.phi + soft_iron_phase_rad_);
  Heading heading;
  heading.stamp = stamp;
  heading.yaw_rad = wrapToPi(
      T_map_base.phi + own_iron_rad + disturbance_rad + random.normal(0.0, params_.sigma_rad));
  heading.sigma_rad = params_.sigma_rad;
  return heading;
}

}  // namespace vestibule::sim
