#pragma once

#include <Eigen/Core>
#include <vector>

#include "vestibule/amcl/global_localizer.hpp"
#include "vestibule/grid/distance_field.hpp"
#include "vestibule/grid/ray_caster.hpp"

namespace vestibule::amcl {

/// A scan's end points in the base frame that have a neighbour on the same surface, in beam order,
/// at least `spacing_m` apart along the contour and at most `count` of them.
[[nodiscard]] std::vector<Point2> spreadEnds(
    const LaserScan& scan, double max_range_m, double spacing_m, std::size_t count);

/// How one scan fits at a pose.
struct ScanFit {
  double log_likelihood = 0.0;  ///< of what is new, 0 = every beam ends on an obstacle
  double inlier_share = 0.0;
  double blocked_share = 0.0;
};

/// Holds scans against a map, by the ends of the beams and by the free space before them.
/// Immutable.
class ScanFitter {
 public:
  ScanFitter(const GlobalParams& params, const grid::OccupancyMap& map);

  [[nodiscard]] const grid::DistanceField& distances() const { return distances_; }

  /// Gauss-Newton on the distances of the end points (METHODS 1.6); `information` holds the pose
  /// where the scan does not, in map axes. The covariance comes from the scan alone, tempered, plus
  /// the information.
  [[nodiscard]] PoseWithCovariance refined(
      const std::vector<Point2>& ends_base,
      const Pose2& T_map_base,
      const Eigen::Matrix3d& information) const;

  /// \param p_base_laser where the rays start
  /// \param news how much each end adds to what is known, see GlobalParams; empty = 1 each
  [[nodiscard]] ScanFit fit(
      const std::vector<Point2>& ends_base,
      const std::vector<double>& news,
      const Point2& p_base_laser,
      const Pose2& T_map_base) const;

 private:
  struct Distance {
    double d_m = 0.0;
    double gx = 0.0;  // gradient in grid axes
    double gy = 0.0;
  };
  [[nodiscard]] Distance interpolated(const Point2& p_grid) const;

  const GlobalParams& params_;
  grid::DistanceField distances_;
  grid::RayCaster rays_;
  int width_;
  int height_;
  double resolution_m_;
  Pose2 T_map_cells_;  // lower left corner of the first cell
};

}  // namespace vestibule::amcl
