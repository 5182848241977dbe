#pragma once

#include <optional>
#include <vector>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/grid/branch_and_bound.hpp"
#include "vestibule/grid/score_field.hpp"

namespace vestibule::grid {

struct CorrelativeParams {
  double half_window_m = 0.3;  ///< about the guess, along its field's axes
  double half_window_rad = degToRad(15.0);
  double step_m = 0.02;
  double step_rad = degToRad(0.25);
  double random_share = 0.1;       ///< of points that hit what is not mapped
  double effective_points = 15.0;  ///< neighbouring points say the same: counted as so many
};
void describe(ParamIo& io, CorrelativeParams& p);

struct CorrelativeMatch {
  Pose2 T_map_base;  ///< the best pose of the lattice
  double score = 0.0;
  /// Mean and covariance of the response: honest in corridors and when several poses fit.
  PoseWithCovariance response;
  bool at_edge = false;  ///< the best pose lies on the rim of the window: look farther
};

/// Correlative matching in a small window about a guess, for scan matching (Olson 2009): all of a
/// coarse lattice of 3 steps and 4 yaw steps, then all fine poses of the cells that fit about as
/// well as the best. Scores are interpolated between cells.
/// The response is exp(effective_points * mean log(random_share + (1 - random_share) * score)); its
/// moments are summed over fine poses where there are any and over coarse cells elsewhere.
class CorrelativeMatcher {
 public:
  explicit CorrelativeMatcher(const CorrelativeParams& params);

  /// Empty when no point is within the field's reach.
  [[nodiscard]] std::optional<CorrelativeMatch> match(
      const ScoreField& field,
      const std::vector<Point2>& points_base,
      const Pose2& T_map_guess,
      const std::optional<PosePrior>& prior = {}) const;

 private:
  CorrelativeParams params_;
  std::array<float, ScoreField::kOne + 1> log_of_byte_;
};

}  // namespace vestibule::grid
