#pragma once

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"

namespace vestibule::mapping {

/// The filter's map.
struct FilterMapParams {
  double resolution_m = 0.05;    ///< [m] cell size
  double max_range_m = 30.0;     ///< [m] what lies farther is not mapped
  double occupied_ratio = 0.25;  ///< hits per visit from which a cell is occupied
  int max_count = 250;           ///< hits and visits stop here, so that the map can forget
};

/// Odometry noise, one sigma per motion between two updates.
struct OdometryNoise {
  double trans_per_trans = 0.20;       ///< [m/m]
  double trans_per_rot = 0.05;         ///< [m/rad]
  double rot_per_trans = 0.08;         ///< [rad/m]
  double rot_per_rot = 0.15;           ///< [rad/rad]
  double min_trans_m = 0.015;          ///< [m] added at every update
  double min_rot_rad = degToRad(0.5);  ///< [rad] added at every update
};

/// Where a scan fits a map: a correlative search, then Gauss-Newton on the cells' mean points.
struct MatcherParams {
  double max_range_m = 30.0;      ///< [m] longer beams are not matched
  int max_beams = 180;            ///< end points used, spread along the contour
  double min_spacing_m = 0.03;    ///< [m] end points are at least this far apart
  double sigma_m = 0.03;          ///< [m] spread of end points about the map's walls
  double z_rand = 0.05;           ///< likelihood of an end point in free space, of a perfect one
  double z_unknown = 0.25;        ///< likelihood of an end point in the unknown
  double effective_beams = 40.0;  ///< neighbouring beams say the same: counted as so many
  int iterations = 8;             ///< of Gauss-Newton, at most
  /// [m] half side of the search: for the odometry, and for what a path has drifted when it comes
  /// back to a place
  double window_m = 0.50;
  double window_rad = degToRad(15.0);
  double wide_window_m = 1.2;  ///< [m] the same when the match is poor or time has passed
  double wide_window_rad = degToRad(25.0);
  double poor_share = 0.5;  ///< fewer beams than this on known walls: the match is poor
};

/// The particle filter.
struct FilterParams {
  int particles = 15;
  double update_d_m = 0.20;             ///< [m] a scan is used after this much motion ...
  double update_a_rad = degToRad(6.0);  ///< [rad] ... or turn
  /// [s] ... or when, looked at so often, the scan no longer fits; 0 = never looked at
  double update_max_s = 1.0;
  double resample_below = 0.5;  ///< share of particles that must stay effective
  /// of the scan's likelihood in the weights; smaller: fewer resamplings, more hypotheses kept
  double weight_power = 0.25;
  double proposal_spread = 1.0;  ///< of the samples, times the proposal's sigma
  /// [m] free space farther from the laser is left to the map that is drawn of the best path
  double free_range_m = 15.0;
  int threads = 0;  ///< 0 = one per core; the result does not depend on it
  FilterMapParams map;
  OdometryNoise odometry;
  MatcherParams matcher;
};

void describe(ParamIo& io, FilterMapParams& p);
void describe(ParamIo& io, OdometryNoise& p);
void describe(ParamIo& io, MatcherParams& p);
void describe(ParamIo& io, FilterParams& p);

}  // namespace vestibule::mapping
