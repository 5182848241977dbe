#include "noise_scale.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::ekf {
namespace {

/// One measurement counts at most so much: a spike is no noise.
constexpr double kMostPerSample = 9.0;
/// So far a quiet time may lower the mean.
constexpr double kLeast = 0.3;
/// A pause teaches nothing [s].
constexpr double kMostInterval_s = 2.0;

}  // namespace

void NoiseScale::note(Timestamp stamp, double nis_per_dof) {
  const double time_s = params_->gnss.adapt_time_s;
  if (time_s <= 0.0 || std::isnan(nis_per_dof)) return;
  const double interval_s =
      last_ ? std::clamp(toSeconds(stamp - *last_), 0.0, kMostInterval_s) : 0.0;
  last_ = stamp;
  const double share = 1.0 - std::exp(-interval_s / time_s);
  const double ratio = std::min(nis_per_dof, kMostPerSample);
  ratio_ = std::clamp(ratio_ + share * (ratio - ratio_), kLeast, params_->gnss.adapt_most);
}

double NoiseScale::value() const { return std::max(1.0, ratio_); }

}  // namespace vestibule::ekf
