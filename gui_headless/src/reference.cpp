#include "reference.hpp"

#include <algorithm>
#include <chrono>

namespace vestibule::gui_headless {
namespace {

double cross(const Point2& o, const Point2& a, const Point2& b) {
  return (a.x - o.x) * (b.y - o.y) - (a.y - o.y) * (b.x - o.x);
}

// Touching with the second end counts, with the first not, so that a step ending on the door line
// and the next one starting there give one crossing.
bool segmentsCross(const Point2& p, const Point2& q, const Point2& a, const Point2& b) {
  const double from = cross(a, b, p);
  const double to = cross(a, b, q);
  const bool changes_side = (from > 0.0) != (to > 0.0);
  const bool between_jambs = (cross(p, q, a) > 0.0) != (cross(p, q, b) > 0.0);
  return changes_side && between_jambs;
}

}  // namespace

StampedPoses referenceOf(const RunRecorder& run, const Scene& scene) {
  StampedPoses reference = scene.reference;
  if (reference.empty()) {
    for (const PoseSample& sample : run.poses(PoseSource::kTruth)) {
      reference.emplace_back(sample.stamp, sample.T.mean);
    }
  }
  std::stable_sort(reference.begin(), reference.end(), [](const auto& a, const auto& b) {
    return a.first < b.first;
  });
  return reference;
}

std::optional<Pose2> referenceAt(const StampedPoses& reference, Timestamp stamp) {
  const auto after =
      std::lower_bound(reference.begin(), reference.end(), stamp, [](const auto& row, Timestamp t) {
        return row.first < t;
      });
  if (after == reference.end()) return std::nullopt;
  if (after->first == stamp) return after->second;
  if (after == reference.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const Duration gap = after->first - before->first;
  if (gap > std::chrono::seconds(3)) return std::nullopt;
  return interpolate(
      before->second, after->second, toSeconds(stamp - before->first) / toSeconds(gap));
}

std::vector<DoorCrossing> doorCrossings(
    const std::vector<PoseSample>& poses, const geo::Site& site) {
  std::vector<DoorCrossing> crossings;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Pose2& p = poses[i - 1].T.mean;
    const Pose2& q = poses[i].T.mean;
    for (const auto& door : site.doors) {
      if (segmentsCross({p.x, p.y}, {q.x, q.y}, door.a, door.b)) {
        crossings.push_back({poses[i].stamp, door.name});
      }
    }
  }
  return crossings;
}

}  // namespace vestibule::gui_headless
