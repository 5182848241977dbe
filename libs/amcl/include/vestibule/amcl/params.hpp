#pragma once

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"

namespace vestibule::amcl {

/// Odometry noise as standard deviations per motion (Gaussian motion model of MRPT).
struct MotionNoise {
  double trans_per_trans = 0.15;       ///< [m/m]
  double trans_per_rot = 0.10;         ///< [m/rad]
  double rot_per_trans = 0.08;         ///< [rad/m]
  double rot_per_rot = 0.25;           ///< [rad/rad]
  double min_trans_m = 0.008;          ///< [m] added at every update
  double min_rot_rad = degToRad(0.3);  ///< [rad] added at every update
};

/// Beam end points against the distance to the nearest mapped obstacle
/// (likelihood field: Thrun, Burgard, Fox, Probabilistic Robotics, section 6.4).
struct LikelihoodField {
  double sigma_hit_m = 0.10;
  double z_hit = 0.50;
  double z_rand = 0.50;
  double max_distance_m = 0.7;  ///< distances are cut here
  double max_range_m = 30.0;    ///< longer beams are not used
  int max_beams = 90;           ///< end points used, spread along the contour
  double min_spacing_m = 0.08;  ///< at least this far apart
  /// Beams are not independent: the log-likelihood is scaled to this many (METHODS: tempering).
  double effective_beams = 18.0;
};

/// Sample size by the Kullback-Leibler distance (Fox, IJRR 2003).
struct Kld {
  int min_particles = 400;
  int max_particles = 6000;
  double epsilon = 0.04;
  double delta = 0.01;
  double bin_m = 0.15;
  double bin_rad = degToRad(5.0);
};

/// Searching again when the scans do not fit.
struct RecoveryParams {
  int after_scans = 8;                ///< used scans in a row that do not fit
  double sigma_m = 0.7;               ///< of the first search around the expected pose
  double sigma_rad = degToRad(40.0);  ///< of the same
  double growth = 2.0;                ///< of both at each further try
  double max_sigma_m = 3.0;           ///< beyond it the whole map is searched
};

struct AmclParams {
  MotionNoise motion;
  LikelihoodField field;
  Kld kld;
  RecoveryParams recovery;
  double update_min_d_m = 0.08;             ///< a scan is used after this much motion ...
  double update_min_a_rad = degToRad(3.0);  ///< ... or turn
  double update_max_s = 1.0;                ///< ... or time, so that standing still converges
  double inlier_distance_m = 0.25;          ///< a beam ending this near to a mapped obstacle fits
  double lost_inlier_share = 0.45;          ///< below it the pose is not trusted
  double trust_time_constant_s = 1.0;       ///< smoothing of the inlier share
  double global_particles_per_m2 = 400.0;   ///< of free space, for global localization
  int global_max_particles = 60000;
};

void describe(ParamIo& io, MotionNoise& p);
void describe(ParamIo& io, LikelihoodField& p);
void describe(ParamIo& io, Kld& p);
void describe(ParamIo& io, RecoveryParams& p);
void describe(ParamIo& io, AmclParams& p);

}  // namespace vestibule::amcl
