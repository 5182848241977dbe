#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "vestibule/amcl/global_localizer.hpp"
#include "vestibule/grid/distance_field.hpp"
#include "vestibule/grid/ray_caster.hpp"

namespace vestibule::amcl {

/// How often squares of surface have been looked at.
class Views {
 public:
  explicit Views(double side_m) : side_m_(side_m) {}
  /// Looks at a point. \return what that adds to what is known: the n-th view of a square 1 / n^2
  double newsOf(const Point2& p);
  /// The same for the way from one point to the next, without the first.
  double newsOf(const Point2& from, const Point2& to);
  void clear() { views_.clear(); }

 private:
  double side_m_;
  std::map<std::pair<long, long>, int> views_;
};

/// What a scan ended on.
struct ScanEnds {
  std::vector<Point2> p_base;  ///< in beam order
  std::vector<char> follows;   ///< per end: 1 = on the surface of the one before
  std::vector<char>
      stand_out;  ///< per end: 1 = of something small that stands before what is behind
};

/// A scan's end points that have a neighbour on the same surface, at least `spacing_m` apart along
/// the contour and at most `count` of them.
/// \param small_m what is no larger than this may stand out
[[nodiscard]] ScanEnds spreadEnds(
    const LaserScan& scan, double max_range_m, double spacing_m, std::size_t count, double small_m);

/// Points in the base frame up to which a scan saw nothing: where beams and their neighbours got no
/// echo within the lidar's sure reach, or one from beyond max_range_m. At most `count`.
[[nodiscard]] std::vector<Point2> spreadGaps(
    const LaserScan& scan, double max_range_m, std::size_t count);

/// The things in a map that are no larger than small_m.
class SmallThings {
 public:
  SmallThings(const grid::OccupancyMap& map, double small_m);
  /// The number, from 1, of the thing whose occupied cells a cell is one of or beside; 0 = none.
  /// \param cell row-major from the bottom left corner
  [[nodiscard]] std::uint32_t at(std::size_t cell) const;

 private:
  std::vector<std::pair<std::size_t, std::uint32_t>> things_;  // by cell, for few cells have any
};

/// What a scan says of something small: mapped and not seen, or seen and not mapped.
struct ThingEvidence {
  std::int64_t thing = 0;       ///< its number; below 0 a square of the map with what is not mapped
  double log_likelihood = 0.0;  ///< that it is where the map has it; 0 = nothing against that
};

/// How one scan fits at a pose.
struct ScanFit {
  /// Of what is new, 0 = every beam ends on an obstacle; without small things.
  double log_likelihood = 0.0;
  std::vector<ThingEvidence> things;  ///< may name one several times
  double inlier_share = 0.0;
  double known_share = 0.0;    ///< of beams that end where the map knows something or passed a wall
  double blocked_share = 0.0;  ///< small mapped things in the way count movable_share
};

/// Holds scans against a map, by the ends of the beams and by the free space before them.
/// Immutable.
class ScanFitter {
 public:
  /// \param params, map outlive it
  /// \param distances of the map; made when null
  ScanFitter(
      const GlobalParams& params,
      const grid::OccupancyMap& map,
      std::shared_ptr<const grid::DistanceField> distances = nullptr);

  [[nodiscard]] const grid::DistanceField& distances() const { return *distances_; }

  /// Gauss-Newton on the distances of the end points (METHODS 1.6); `information` holds the pose
  /// where the scan does not, in map axes. The covariance comes from the scan alone, tempered, plus
  /// the information.
  [[nodiscard]] PoseWithCovariance refined(
      const ScanEnds& ends, const Pose2& T_map_base, const Eigen::Matrix3d& information) const;

  /// \param p_base_laser where the rays start
  /// \param news how much each end adds to what is known, see GlobalParams; empty = 1 each
  /// \param missing of mapped surfaces that beams have passed through; these are counted
  [[nodiscard]] ScanFit fit(
      const ScanEnds& ends,
      const std::vector<double>& news,
      const std::vector<Point2>& gaps_base,
      const Point2& p_base_laser,
      const Pose2& T_map_base,
      Views& missing) const;

 private:
  struct Distance {
    double d_m = 0.0;
    double gx = 0.0;  // gradient in grid axes
    double gy = 0.0;
  };
  struct CellIndex {
    int x = 0;
    int y = 0;
  };
  /// Empty off the map.
  [[nodiscard]] std::optional<CellIndex> cellAt(const Point2& p_cells) const;
  /// Whether a point lies in a cell of the map that nobody has seen.
  [[nodiscard]] bool isUnknown(const Point2& p_cells) const;
  /// The small thing that a mapped obstacle belongs to; 0 = none.
  [[nodiscard]] std::int64_t thingAt(const Point2& p_map_obstacle) const;
  [[nodiscard]] Distance interpolated(const Point2& p_grid) const;
  /// The first mapped obstacle on the way to a point, more than margin_m before it.
  [[nodiscard]] std::optional<Point2> obstacleBefore(
      const Point2& p_map_end, const Point2& p_map_laser, double margin_m) const;

  const GlobalParams& params_;
  const grid::OccupancyMap& map_;
  std::shared_ptr<const grid::DistanceField> distances_;
  grid::RayCaster rays_;
  SmallThings movable_;
  int width_;
  int height_;
  double resolution_m_;
  Pose2 T_map_cells_;  // lower left corner of the first cell
};

}  // namespace vestibule::amcl
