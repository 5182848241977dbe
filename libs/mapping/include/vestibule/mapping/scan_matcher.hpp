#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/mapping/params.hpp"
#include "vestibule/mapping/patch_map.hpp"
#include "vestibule/mapping/scan_points.hpp"

namespace vestibule::mapping {

/// What is known of a pose before the scan is looked at. `information` orders x, y [1/m^2],
/// yaw [1/rad^2], in the axes of the map.
struct PosePrior {
  Pose2 mean;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
};

/// How a scan fits a map at a pose.
struct ScanFit {
  double log_likelihood = 0.0;  ///< tempered: as of MatcherParams::effective_beams beams
  double matched_share = 0.0;   ///< of all points: near a mapped obstacle
  double known_share = 0.0;     ///< of the points in seen cells: near a mapped obstacle
};

/// The pose that fits scan and prior best.
struct Refinement {
  Pose2 T_map_base;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< of the scan alone, tempered
  double prior_chi2 = 0.0;  ///< squared distance from the prior's mean
};

/// Matches scans with a PatchMap. Holds scratch memory: one matcher per thread.
class ScanMatcher {
 public:
  explicit ScanMatcher(const MatcherParams& params) : params_(params) {}

  [[nodiscard]] ScanFit fit(
      const PatchMap& map, const ScanPoints& scan, const Pose2& T_map_base) const;

  /// Gauss-Newton from `start` on the distances of the end points to the mean points around them:
  /// across the surface where the scan shows one, in both directions elsewhere. Within about one
  /// cell of the right pose.
  [[nodiscard]] Refinement refine(
      const PatchMap& map,
      const ScanPoints& scan,
      const Pose2& start,
      const PosePrior& prior) const;

  /// The best pose on a lattice of one cell around the prior's mean, by branch and bound over
  /// translations. The prior counts up to a bound, so that a clear match far from it wins.
  /// \param window_m, window_rad  half sides of the search
  [[nodiscard]] Pose2 search(
      const PatchMap& map,
      const ScanPoints& scan,
      const PosePrior& prior,
      double window_m,
      double window_rad);

 private:
  struct Field {
    int x0 = 0, y0 = 0, width = 0, height = 0;
    std::vector<std::uint8_t> cells;
  };
  void drawField(const PatchMap& map, int x0, int y0, int x1, int y1);

  MatcherParams params_;
  Field field_;                                 // occupied cells, blurred
  std::vector<std::vector<std::uint8_t>> max_;  // per level: maximum over 2^level cells
};

}  // namespace vestibule::mapping
