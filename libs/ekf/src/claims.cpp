#include "vestibule/ekf/claims.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::ekf {

double leastSigma(GnssFixType type, const GnssParams& params) {
  switch (type) {
    case GnssFixType::kRtkFixed:
      return params.sigma_rtk_fixed_m;
    case GnssFixType::kRtkFloat:
      return params.sigma_rtk_float_m;
    case GnssFixType::kDifferential:
      return params.sigma_differential_m;
    case GnssFixType::kSingle:
    case GnssFixType::kUnknown:
    case GnssFixType::kNone:
      break;
  }
  return params.sigma_single_m;
}

std::optional<double> absoluteSigma(const Heading& heading, const FilterParams& params) {
  const HeadingParams& p = params.heading;
  const double sigma = std::max(heading.sigma_rad.value_or(0.0), p.sigma_rad);
  const bool calibrated = heading.offset_sigma_rad.has_value();
  // A sensor that doubts itself is not trusted, whatever the configuration says.
  if (!(params.init.trust_heading || calibrated) || !(sigma <= params.init.max_yaw_sigma_rad)) {
    return std::nullopt;
  }
  // A calibration knows nothing of the steel the robot starts beside.
  return std::hypot(
      sigma,
      heading.offset_sigma_rad.value_or(p.offset_sigma_rad),
      calibrated ? p.disturbance_sigma_rad : 0.0);
}

}  // namespace vestibule::ekf
