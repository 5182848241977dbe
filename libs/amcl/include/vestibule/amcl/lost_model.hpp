#pragma once

namespace vestibule::amcl {

/// What a scan says about whether the localizer is where it believes to be.
struct LostEvidence {
  double inlier_share = 0.0;       ///< beams ending near a mapped obstacle, [0, 1]
  double blocked_share = 0.0;      ///< beams that pass through a mapped obstacle and end on none
  double slow_inlier_share = 0.0;  ///< the same two over a longer time
  double slow_blocked_share = 0.0;
  double off_map_share = 0.0;    ///< beams ending in cells nobody has seen, or beyond the map
  double spread_m = 0.0;         ///< of all particles, one sigma
  double odometry_chi2 = 0.0;    ///< correction of the odometry against its covariance, per dof
  double weakest_sigma_m = 0.0;  ///< of the direction the scan says least about
};

/// Probability of being lost (true pose farther than 0.5 m or 10 degrees from the estimate): a
/// logistic model of the smoothed evidence, fitted on simulated drives with crowds, kidnaps and
/// wrong maps (docs/localization.md; `vestibule bench lost` measures its calibration).
[[nodiscard]] double lostProbability(const LostEvidence& smoothed);

}  // namespace vestibule::amcl
