#pragma once

#include "vestibule/amcl/global_params.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"

namespace vestibule::amcl {

/// How the wheels move the robot, and so how odometry errs.
enum class MotionModel {
  kDifferential,  ///< two wheels: errors along the way and in the turn
  kOmni,          ///< moves sideways on purpose: errs along and across alike
  kSkidSteer      ///< slips sideways when it turns, about a centre that may lie off its axis
};

/// Odometry noise as standard deviations per motion.
struct MotionNoise {
  MotionModel model = MotionModel::kDifferential;
  double trans_per_trans = 0.15;       ///< [m/m] along the way
  double trans_per_rot = 0.05;         ///< [m/rad]
  double rot_per_trans = 0.08;         ///< [rad/m] of the wheels' yaw
  double rot_per_rot = 0.20;           ///< [rad/rad] of the wheels' yaw
  double gyro_rot_per_rot = 0.03;      ///< [rad/rad] where a gyro measures the turn
  double lateral_per_trans = 0.10;     ///< [m/m] across the way
  double lateral_per_rot = 0.10;       ///< [m/rad] skid-steer only
  double icr_x_m = 0.0;                ///< skid-steer only: v_y = -omega * icr_x
  double min_trans_m = 0.005;          ///< [m] added at every update
  double min_rot_rad = degToRad(0.2);  ///< [rad] added at every update
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
  /// Beams are not independent, nor are scans a few centimetres apart: the log-likelihood is scaled
  /// to this many (tempering).
  double effective_beams = 9.0;
};

/// Beams that hit things which are not in the map (people, boxes) are left out of weighing, once
/// the particles agree where the robot is.
struct BeamSkipping {
  bool enabled = true;
  double distance_m = 0.5;   ///< a beam fits a particle when it ends this near to an obstacle
  double min_share = 0.3;    ///< beams that fit fewer particles are left out ...
  double max_skipped = 0.9;  ///< ... unless so many would be: then the pose is wrong, not the map
};

/// Sub-cell pose of the best particles (Gauss-Newton on the distance field).
struct RefinementParams {
  bool enabled = true;
  double min_sigma_m = 0.03;  ///< spread of beam ends about obstacles: estimated, at least this ...
  double max_sigma_m = 0.25;  ///< ... and at most this
  double clutter = 0.03;      ///< density of ends anywhere, against 1 on an obstacle
  double max_distance_m = 0.7;    ///< ends farther from every obstacle are not looked at
  double effective_beams = 60.0;  ///< beams are not independent: counted as so many
  double map_sigma_m = 0.008;     ///< error of the map itself, does not average out
  double map_sigma_rad = degToRad(0.1);
  int max_beams = 240;
  int iterations = 12;
  double injected_share = 0.02;  ///< of the particles, drawn about the refined pose
};

/// Drawing new particles from the weights.
struct Resampling {
  double below_effective_share = 0.5;  ///< only when fewer particles carry the weight
  double kernel = 0.5;                 ///< spread of the new about the old, times n^(-1/7)
  double min_effective_share = 0.05;   ///< a scan is made blunter until so many remain
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

/// Searching the map again when the scans do not fit.
struct RecoveryParams {
  int after_scans = 8;  ///< used scans in a row that do not fit
  /// More beams through what is mapped than this: does not fit. Holds where lost_inlier_share of
  /// the beams fit, and grows with what does.
  double max_blocked_share = 0.25;
};

/// GNSS fixes, where a map is georeferenced: as one more term of the particles' weights, and, with
/// headings that can be trusted, as what is known beforehand when the map is searched.
struct GnssTerm {
  bool in_search = true;     ///< as a prior of searches
  bool enabled = false;      ///< as a term of the weights
  double min_sigma_m = 1.0;  ///< fixes are never held for better than this
  double clutter = 0.05;     ///< a fix may be wrong: density anywhere, against 1 at the fix
};

struct AmclParams {
  MotionNoise motion;
  LikelihoodField field;
  BeamSkipping beam_skipping;
  RefinementParams refinement;
  Resampling resampling;
  GnssTerm gnss;
  Kld kld;
  RecoveryParams recovery;
  GlobalParams global;
  double update_min_d_m = 0.08;             ///< a scan is used after this much motion ...
  double update_min_a_rad = degToRad(3.0);  ///< ... or turn
  double update_max_s = 1.0;                ///< ... or time, so that standing still converges
  double inlier_distance_m = 0.25;          ///< a beam ending this near to a mapped obstacle fits
  double lost_inlier_share = 0.45;          ///< below it the pose is not trusted
  double trust_time_constant_s = 1.0;       ///< smoothing of the inlier share
  double global_particles_per_m2 = 400.0;   ///< of free space, for global localization
  int global_max_particles = 60000;
  int threads = 1;  ///< for many particles; the result does not depend on it
};

void describe(ParamIo& io, MotionNoise& p);
void describe(ParamIo& io, LikelihoodField& p);
void describe(ParamIo& io, BeamSkipping& p);
void describe(ParamIo& io, RefinementParams& p);
void describe(ParamIo& io, Resampling& p);
void describe(ParamIo& io, GnssTerm& p);
void describe(ParamIo& io, Kld& p);
void describe(ParamIo& io, RecoveryParams& p);
void describe(ParamIo& io, AmclParams& p);

}  // namespace vestibule::amcl
