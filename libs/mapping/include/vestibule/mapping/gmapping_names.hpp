#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vestibule/mapping/params.hpp"

namespace vestibule::mapping {

/// GMapping's parameters by their own names; docs/mapping.md says what each does here.
struct GmappingNames {
  // with a meaning here
  std::optional<double> particles, linearUpdate, angularUpdate, temporalUpdate, resampleThreshold;
  std::optional<double> srr, srt, str, stt;
  std::optional<double> sigma, lsigma, ogain, lskip, minimumScore;
  std::optional<double> iterations, maxUrange, maxRange, delta, occ_thresh;
  // accepted; there is nothing to set
  std::optional<double> kernelSize, lstep, astep, llsamplerange, llsamplestep, lasamplerange,
      lasamplestep, xmin, ymin, xmax, ymax, throttle_scans, map_update_interval,
      transform_publish_period, tf_delay;

  /// Writes those that are set into our parameters.
  void applyTo(FilterParams& params) const;
  /// The names that are set and change nothing.
  [[nodiscard]] std::vector<std::string> withoutEffect() const;
};
void describe(ParamIo& io, GmappingNames& names);

}  // namespace vestibule::mapping
