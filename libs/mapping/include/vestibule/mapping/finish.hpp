#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/mapping/pose_graph.hpp"
#include "vestibule/mapping/scan_node.hpp"
#include "vestibule/mapping/track.hpp"

namespace vestibule::mapping {

/// When a place that looks like an earlier one is taken for it.
struct ClosureParams {
  double submap_m = 5.0;        ///< [m] of travel in one submap
  double reach_m = 12.0;        ///< [m] submaps whose centres may be this near are compared
  double min_score = 0.55;      ///< of the search, 0..1
  double min_agreement = 0.75;  ///< of the points about which the other submap says something
  double min_matched = 0.25;    ///< share of all points on walls of the other submap
  double max_window_m = 15.0;   ///< [m] half side of the search, however uncertain the way there
  double max_window_rad = degToRad(60.0);
  /// Of the error against what the way there says, and between two closures: chi-square quantile.
  double gate_probability = 0.99;
  double partner_m = 15.0;  ///< [m] of travel in which a second closure must confirm the first
  int rounds = 4;           ///< of searching and optimising, at most
};

/// Joint refinement of all poses on the surfaces that the scans share.
struct RefineParams {
  double max_range_m = 25.0;       ///< [m] longer beams are not used
  double sigma_m = 0.03;           ///< [m] of an end point about the surface another scan saw
  double gate_m = 0.25;            ///< [m] points farther apart do not belong together
  double effective_points = 30.0;  ///< neighbouring points say the same: counted as so many
  double pair_m = 4.0;             ///< [m] key scans nearer than this are compared
  int pairs_per_scan = 10;         ///< of different passes, besides its neighbours on the way
  double min_agreement = 0.8;      ///< of a pair of scans, to be compared at all
  int iterations = 15;
};

/// The little of it that every drive gets.
struct SmoothParams {
  int iterations = 8;  ///< 0 = the filter's path as it is
  int pairs_per_scan = 3;
};

struct FinishParams {
  int threads = 0;  ///< 0 = one per core; the result does not depend on it
  ClosureParams closures;
  RefineParams refine;
};
void describe(ParamIo& io, ClosureParams& p);
void describe(ParamIo& io, RefineParams& p);
void describe(ParamIo& io, SmoothParams& p);
void describe(ParamIo& io, FinishParams& p);

enum class ClosureVerdict {
  kAccepted,
  kConflict,   ///< scans contradict each other there
  kAmbiguous,  ///< another place fits about as well
  kUnlikely,   ///< too far from what the way there allows
  kAlone,      ///< no second closure confirms it
  kOutvoted    ///< the optimised graph contradicts it
};
inline constexpr ClosureVerdict kClosureVerdicts[] = {
    ClosureVerdict::kAccepted,
    ClosureVerdict::kConflict,
    ClosureVerdict::kAmbiguous,
    ClosureVerdict::kUnlikely,
    ClosureVerdict::kAlone,
    ClosureVerdict::kOutvoted};
[[nodiscard]] std::string_view toString(ClosureVerdict verdict);

/// A place recognised again: node `to` seen from node `from`.
struct Closure {
  std::size_t from = 0;
  std::size_t to = 0;
  Pose2 T_from_to;
  ClosureVerdict verdict = ClosureVerdict::kAccepted;
  double agreement = 0.0;
  double matched = 0.0;
  double chi2 = 0.0;  ///< of its error against the way there
  Pose2 T_map_from;   ///< of the two nodes, corrected
  Pose2 T_map_to;
};

struct FinishResult {
  std::vector<ScanNode> nodes;        ///< with the corrected T_map_base
  std::vector<Closure> closures;      ///< accepted and refused ones, by `from`
  std::vector<std::size_t> keys;      ///< nodes of the pose graph
  std::vector<PoseConstraint> graph;  ///< its constraints; from and to count in `keys`
  std::size_t submaps = 0;
  std::size_t pairs = 0;              ///< of scans in the joint refinement
  double surface_rms_before_m = 0.0;  ///< distance between surfaces that two scans share
  double surface_rms_after_m = 0.0;
  double largest_correction_m = 0.0;  ///< of a node against its estimate before

  [[nodiscard]] std::size_t count(ClosureVerdict verdict) const;
};

/// Each used scan seen from the one before it: the relative pose as estimated, its certainty from
/// both scans and the odometry. A link that the scans contradict is left loose.
/// \param used  numbers of the used scans, ascending; from and to of the links count in it
[[nodiscard]] std::vector<PoseConstraint> chainOf(
    const std::vector<ScanNode>& nodes,
    const std::vector<std::size_t>& used,
    const FinishParams& params);

/// Takes the jitter out of a drive that the filter mapped: its used scans are refined together on
/// the surfaces that they share, the others placed on them. No loop is looked for, and what drifted
/// apart by more than the gate stays apart. The first node keeps its pose. The result does not
/// depend on the number of threads.
/// \param used    numbers of the used scans, ascending, from 0
/// \param params  its threads and what `refine` has besides `smooth`
void smoothDrive(
    std::vector<ScanNode>& nodes,
    const std::vector<std::size_t>& used,
    const SmoothParams& smooth,
    const FinishParams& params,
    const ShareDone& progress);

/// Corrects a drive that was mapped: finds places seen again, fits all poses to that (pose graph
/// with robust weights), then refines all poses together on the surfaces that scans share.
/// \param nodes  in the order of the drive, with an estimate that is right from scan to scan; it
///   may have drifted (see trackScans for a raw odometry)
/// The first node keeps its pose. The result does not depend on the number of threads.
[[nodiscard]] FinishResult finishMap(
    std::vector<ScanNode> nodes, const FinishParams& params, const ShareDone& progress);

}  // namespace vestibule::mapping
