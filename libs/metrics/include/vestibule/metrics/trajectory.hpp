#pragma once

#include <cstddef>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/metrics/statistics.hpp"

namespace vestibule::metrics {

struct TimedPose {
  Timestamp stamp;
  Pose2 pose;
};
/// In file order; stamps may repeat and may run backwards.
using Trajectory = std::vector<TimedPose>;

enum class Matching {
  kNearest,      ///< the reference pose with the nearest stamp
  kInterpolated  ///< the reference between its two neighbours, constant twist
};

struct AssociationOptions {
  Matching matching = Matching::kNearest;
  /// Largest difference of stamps; when interpolating, to the nearer of the two neighbours, both of
  /// which must exist. Zero asks for identical stamps.
  Duration max_dt = std::chrono::milliseconds(10);
};

struct Match {
  Timestamp stamp;  ///< of the estimate
  Pose2 estimate;
  Pose2 reference;
};

/// One match per estimate that has a partner, in the order of the estimate. Where several reference
/// poses are equally near (repeated stamps), the one that continues the file order is taken.
[[nodiscard]] std::vector<Match> associate(
    const Trajectory& estimate,
    const Trajectory& reference,
    const AssociationOptions& options = {});

enum class Alignment { kNone, kSe2 };

struct PoseErrors {
  Statistics translation_m;
  Statistics yaw_rad;
  Pose2 T_reference_estimate;  ///< applied to the estimate; identity without alignment
};

/// The planar rigid motion that brings the estimated positions nearest to the reference positions
/// (least squares, no scale; Umeyama 1991). Identity when there is nothing to fit.
[[nodiscard]] Pose2 alignSe2(const std::vector<Match>& matches);

/// Absolute pose error.
[[nodiscard]] PoseErrors absoluteErrors(const std::vector<Match>& matches, Alignment alignment);

/// Relative pose error over pairs (i, j), j the first match at least `step` further on.
[[nodiscard]] PoseErrors relativeErrorsOverDistance(
    const std::vector<Match>& matches, double step_m);  ///< along the reference path
[[nodiscard]] PoseErrors relativeErrorsOverTime(const std::vector<Match>& matches, Duration step);

}  // namespace vestibule::metrics
