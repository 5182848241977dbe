#include "vestibule/metrics/trajectory.hpp"

#include <cmath>

#include "lookup.hpp"
#include "vestibule/core/angles.hpp"

namespace vestibule::metrics {
namespace {

/// Error of a pose against its reference, both in the same frame.
struct ErrorLists {
  std::vector<double> translation_m;
  std::vector<double> yaw_rad;
  void add(const Pose2& reference, const Pose2& estimate) {
    translation_m.push_back(distance(reference, estimate));
    yaw_rad.push_back(std::abs(angleDiff(estimate.phi, reference.phi)));
  }
  [[nodiscard]] PoseErrors figures() {
    PoseErrors errors;
    errors.translation_m = statistics(std::move(translation_m));
    errors.yaw_rad = statistics(std::move(yaw_rad));
    return errors;
  }
};

/// `far(i, j)` says that match j is at least a step beyond match i.
template <class Far>
PoseErrors relativeErrors(const std::vector<Match>& matches, const Far& far) {
  ErrorLists errors;
  std::size_t j = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    j = std::max(j, i + 1);
    while (j < matches.size() && !far(i, j)) ++j;
    if (j >= matches.size()) break;
    errors.add(
        between(matches[i].reference, matches[j].reference),
        between(matches[i].estimate, matches[j].estimate));
  }
  return errors.figures();
}

}  // namespace

std::vector<Match> associate(
    const Trajectory& estimate, const Trajectory& reference, const AssociationOptions& options) {
  const StampIndex index(reference);
  std::vector<Match> matches;
  std::optional<std::size_t> previous;
  for (const TimedPose& pose : estimate) {
    if (options.matching == Matching::kInterpolated) {
      if (const auto at = index.interpolated(pose.stamp, options.max_dt)) {
        matches.push_back({pose.stamp, pose.pose, *at});
      }
    } else if (const auto i = index.nearest(pose.stamp, options.max_dt, previous)) {
      matches.push_back({pose.stamp, pose.pose, reference[*i].pose});
      previous = i;
    }
  }
  return matches;
}

Pose2 alignSe2(const std::vector<Match>& matches) {
  if (matches.empty()) return {};
  const auto n = static_cast<double>(matches.size());
  Point2 mean_estimate;
  Point2 mean_reference;
  for (const Match& m : matches) {
    mean_estimate += Point2(m.estimate.x / n, m.estimate.y / n);
    mean_reference += Point2(m.reference.x / n, m.reference.y / n);
  }
  // In the plane the rotation of the least-squares fit has a closed form.
  double dot = 0.0;
  double cross = 0.0;
  for (const Match& m : matches) {
    const double ax = m.estimate.x - mean_estimate.x;
    const double ay = m.estimate.y - mean_estimate.y;
    const double bx = m.reference.x - mean_reference.x;
    const double by = m.reference.y - mean_reference.y;
    dot += ax * bx + ay * by;
    cross += ax * by - ay * bx;
  }
  const double yaw = std::atan2(cross, dot);
  const Point2 turned = transform(Pose2(0, 0, yaw), mean_estimate);
  return {mean_reference.x - turned.x, mean_reference.y - turned.y, yaw};
}

PoseErrors absoluteErrors(const std::vector<Match>& matches, Alignment alignment) {
  const Pose2 T_reference_estimate = alignment == Alignment::kSe2 ? alignSe2(matches) : Pose2();
  ErrorLists errors;
  for (const Match& m : matches) errors.add(m.reference, compose(T_reference_estimate, m.estimate));
  PoseErrors result = errors.figures();
  result.T_reference_estimate = T_reference_estimate;
  return result;
}

PoseErrors relativeErrorsOverDistance(const std::vector<Match>& matches, double step_m) {
  std::vector<double> path_m(matches.size(), 0.0);
  for (std::size_t i = 1; i < matches.size(); ++i) {
    path_m[i] = path_m[i - 1] + distance(matches[i - 1].reference, matches[i].reference);
  }
  return relativeErrors(
      matches, [&](std::size_t i, std::size_t j) { return path_m[j] - path_m[i] >= step_m; });
}

PoseErrors relativeErrorsOverTime(const std::vector<Match>& matches, Duration step) {
  return relativeErrors(matches, [&](std::size_t i, std::size_t j) {
    return matches[j].stamp - matches[i].stamp >= step;
  });
}

}  // namespace vestibule::metrics
