#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/grid/score_field.hpp"

namespace vestibule::grid {

/// Where the base may be, per cell of a ScoreField: free space, zones, the inside of a polygon.
class BaseMask {
 public:
  /// \param allowed row-major from the bottom left, one per cell of the field; 0 = not there
  BaseMask(int width, int height, std::vector<std::uint8_t> allowed);
  /// Cells of the field in which at least one map cell is free.
  static BaseMask freeSpace(const ScoreField& field, const OccupancyMap& map);

  /// True if some cell of the square [ix, ix + 2^level) x [iy, iy + 2^level) is allowed.
  /// \pre ix and iy are multiples of 2^level
  [[nodiscard]] bool any(int level, int ix, int iy) const;

 private:
  struct Level {
    int width = 0;
    std::vector<std::uint8_t> any;
  };
  std::array<Level, ScoreField::kTop + 1> levels_;
};

/// The poses to search: a rectangle along the field's axes about a centre, and a yaw interval.
struct SearchWindow {
  Pose2 T_map_centre;
  double half_x_m = 0.0;
  double half_y_m = 0.0;
  double half_yaw_rad = kPi;
};
/// Everywhere on the field, any yaw.
[[nodiscard]] SearchWindow wholeField(const ScoreField& field);

/// What is known beforehand, as a penalty on the score:
/// weight * min(d^2, max_d2), d^2 the squared Mahalanobis distance (x, y, yaw).
struct PosePrior {
  Pose2 T_map_base;
  /// Inverse covariance in map axes; zero rows for what is not known (yaw from GNSS).
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  double weight = 0.01;  ///< score lost per unit of d^2
  double max_d2 = 50.0;
};

struct BranchAndBoundParams {
  double min_score = 0.5;        ///< poses below it are no match
  double relative_score = 0.75;  ///< nor are those below this share of the best score
  int max_matches = 50;
  double separation_m = 1.0;  ///< of two matches, unless their yaws differ by ...
  double separation_rad = degToRad(30.0);
  /// The yaw step turns a point at this range (or the farthest, if nearer) by one cell.
  double yaw_radius_m = 8.0;
  int threads = 0;  ///< 0 = one per core; the result does not depend on it
};
void describe(ParamIo& io, BranchAndBoundParams& p);

struct PoseMatch {
  Pose2 T_map_base;
  double score = 0.0;  ///< mean score of the points less the penalty of the prior
};

/// Finds where a set of points fits a score field: all separate places with their scores, best
/// first. Exact on its lattice (cell centres times yaw steps), by branch and bound over squares of
/// 8, 4, 2 and 1 cells.
///
/// A match is the best pose of its block of 8 x 8 cells and an eighth of the circle; the
/// 4 * max_matches best blocks compete in non-maximum suppression. Equal scores are ordered by yaw,
/// row and column, so the result does not depend on the number of threads.
class BranchAndBoundMatcher {
 public:
  explicit BranchAndBoundMatcher(const BranchAndBoundParams& params) : params_(params) {}

  /// \param points_base in the base frame; those beyond the field's reach are dropped, and more
  ///   than 256 are thinned evenly
  /// \param mask may be null; of the field's size
  [[nodiscard]] std::vector<PoseMatch> match(
      const ScoreField& field,
      const std::vector<Point2>& points_base,
      const SearchWindow& window,
      const BaseMask* mask = nullptr,
      const std::optional<PosePrior>& prior = {}) const;

 private:
  BranchAndBoundParams params_;
};

}  // namespace vestibule::grid
