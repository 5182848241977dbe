#pragma once

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/grid/branch_and_bound.hpp"

namespace vestibule::amcl {

/// Finding the place in a whole map, and when to believe it.
struct GlobalParams {
  // --- the search: branch and bound over the map ---------------------------------------------
  grid::BranchAndBoundParams search;
  double cell_m = 0.10;       ///< of the search lattice
  double sigma_m = 0.15;      ///< spread of a hit about a mapped obstacle, in the search
  double max_range_m = 20.0;  ///< longer beams are not used
  int points = 100;           ///< spread over what the last scans saw
  // --- the evidence: every place that was found against every scan since ------------------------
  double key_distance_m = 0.4;           ///< a scan counts after this much motion ...
  double key_turn_rad = degToRad(30.0);  ///< ... or turn
  int max_keys = 60;                     ///< scans remembered
  double sigma_hit_m = 0.08;             ///< spread of a hit about a mapped obstacle
  double random_share = 0.10;            ///< of beams that hit what is not mapped
  double blocked_share = 0.02;           ///< of beams that pass through what is mapped
  double no_echo_share = 0.10;           ///< of mapped surfaces that give no echo (dark, glass)
  /// Evidence counts surfaces, not beams, or a moved desk seen in fifty scans would outvote the
  /// walls: of a square of surface_m the first view counts fully, the n-th 1 / n^2, and neighbours
  /// say so much the same that each counts surface_share.
  double surface_m = 0.25;
  double surface_share = 0.25;
  /// Small things move, walls do not: what is no larger than small_m, in the map or before a wall
  /// in a scan, counts movable_share; so do ends where the map knows nothing.
  double small_m = 3.0;
  double movable_share = 0.25;
  double moved_share = 0.2;  ///< of these that are elsewhere by now: one says no more than its log
  double inlier_distance_m = 0.20;  ///< a beam ending this near to an obstacle fits
  // --- the decision ------------------------------------------------------------------------------
  double min_travel_m = 1.0;        ///< driven before a place is believed ...
  int min_keys = 4;                 ///< ... and scans that fit there
  double min_inlier_share = 0.55;   ///< of the beams, on average
  double max_blocked_share = 0.15;  ///< of the beams, on average
  double min_advantage = 8.0;   ///< log odds of the best place against all others, 3/4 from 15 m on
  double first_search_m = 1.0;  ///< driven between two searches, doubled from one to the next
  double max_search_m = 4.0;    ///< but no more than this
};
void describe(ParamIo& io, GlobalParams& p);

}  // namespace vestibule::amcl
