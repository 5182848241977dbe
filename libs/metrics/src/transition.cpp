#include "vestibule/metrics/transition.hpp"

#include <cmath>

#include "lookup.hpp"
#include "vestibule/core/angles.hpp"

namespace vestibule::metrics {
namespace {

/// `expected` and `actual` are the same pose, once without and once with what is to be measured.
void record(Step& step, const Pose2& expected, const Pose2& actual, Timestamp stamp) {
  ++step.pairs;
  const double moved_m = distance(expected, actual);
  const double turned_rad = std::abs(angleDiff(actual.phi, expected.phi));
  if (moved_m > step.position_m) {
    step.position_m = moved_m;
    step.position_stamp = stamp;
  }
  if (turned_rad > step.yaw_rad) {
    step.yaw_rad = turned_rad;
    step.yaw_stamp = stamp;
  }
}

}  // namespace

Step largestCorrection(
    const Trajectory& T_map_base, const Trajectory& T_odom_base, Duration window) {
  const StampIndex odometry(T_odom_base);
  std::vector<std::optional<Pose2>> odometry_at;
  odometry_at.reserve(T_map_base.size());
  for (const TimedPose& pose : T_map_base) {
    odometry_at.push_back(odometry.interpolated(pose.stamp, Duration::max()));
  }
  Step step;
  for (std::size_t i = 0; i < T_map_base.size(); ++i) {
    if (!odometry_at[i]) continue;
    for (std::size_t j = i + 1; j < T_map_base.size(); ++j) {
      const TimedPose& later = T_map_base[j];
      if (later.stamp < T_map_base[j - 1].stamp) break;
      if (j > i + 1 && later.stamp - T_map_base[i].stamp > window) break;
      if (!odometry_at[j]) continue;
      const Pose2 moved = between(*odometry_at[i], *odometry_at[j]);
      record(step, compose(T_map_base[i].pose, moved), later.pose, later.stamp);
    }
  }
  return step;
}

Step largestJump(const Trajectory& T_map_base) {
  Step step;
  for (std::size_t i = 1; i < T_map_base.size(); ++i) {
    record(step, T_map_base[i - 1].pose, T_map_base[i].pose, T_map_base[i].stamp);
  }
  return step;
}

}  // namespace vestibule::metrics
