#pragma once

#include <Eigen/Core>

namespace vestibule::amcl {

/// What the scans say about whether the localizer is where it believes to be: smoothed over
/// AmclParams::trust_time_constant_s, the slow ones over ten seconds.
struct LostEvidence {
  double inlier_share = 0.0;    ///< beams ending near a mapped obstacle, [0, 1]
  double agreeing_share = 0.0;  ///< beams as long as the map says, within 0.25 m
  double slow_agreeing_share = 0.0;
  double sharp_share = 0.0;          ///< mean of exp(-d^2/2s^2) over the beams' ends, s = 0.1 m
  double slow_blocked_share = 0.0;   ///< beams that pass through an obstacle and end on none
  double worst_blocked_share = 0.0;  ///< the same at its worst of the last 30 m or so
  double off_map_share = 0.0;        ///< beams ending in cells nobody has seen, or beyond the map
  double spread_m = 0.0;             ///< of all particles, one sigma
  double weakest_sigma_m = 0.0;      ///< of the direction the scan says least about
};

/// What the probability of being lost is a logistic function of, the constant 1 first.
using LostFeatures = Eigen::Matrix<double, 8, 1>;
[[nodiscard]] LostFeatures lostFeatures(const LostEvidence& smoothed);
/// The logistic function of weights and features.
[[nodiscard]] double lostProbability(const LostFeatures& weights, const LostFeatures& features);

/// Probability of being lost (true pose farther than 0.5 m or 10 degrees from the estimate): a
/// logistic model of the smoothed evidence, fitted on simulated drives with crowds, kidnaps and
/// wrong maps (docs/localization.md; `vestibule bench lost` measures its calibration).
[[nodiscard]] double lostProbability(const LostEvidence& smoothed);

}  // namespace vestibule::amcl
