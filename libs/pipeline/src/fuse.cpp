#include "vestibule/pipeline/fuse.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/core/errors.hpp"
#include "vestibule/ekf/filter.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/metrics/transition.hpp"
#include "vestibule/pipeline/gnss_input.hpp"
#include "vestibule/pipeline/time_ordered_queue.hpp"

namespace vestibule::pipeline {
namespace {

/// One recording on its way through the filter.
class Fusion {
 public:
  Fusion(const Config& config, const Observers& observers)
      : observers_(observers), filter_(config.ekf, config.rig, &observers) {}

  void process(const Measurement& measurement) {
    const Timestamp stamp = stampOf(measurement);
    first_ = first_ ? std::min(*first_, stamp) : stamp;
    last_ = last_ ? std::max(*last_, stamp) : stamp;
    if (const auto* wheels = std::get_if<WheelOdometry>(&measurement)) {
      filter_.process(*wheels);
      ++wheel_messages;
      if (filter_.time() == wheels->stamp) output();
    } else if (const auto* imu = std::get_if<Imu>(&measurement)) {
      filter_.process(*imu);
    } else if (const auto* heading = std::get_if<Heading>(&measurement)) {
      (void)filter_.process(*heading);
    } else if (const auto* fix = std::get_if<GnssFix>(&measurement)) {
      onFix(*fix);
    }
    if (!result.ready_after_s && filter_.ready()) {
      result.ready_after_s = toSeconds(filter_.time() - *first_);
      placeHeldBack();
    }
  }

  void finish() {
    result.data_s = first_ ? toSeconds(*last_ - *first_) : 0.0;
    result.waiting_for = filter_.waitingFor();
    if (!result.ready_after_s) {
      // Without any fix the odometry frame is all there is.
      for (const auto& [pose, cov] : held_back_) append(pose.stamp, {pose.pose, cov});
    }
    result.largest_jump_m = metrics::largestJump(result.trajectory).position_m;
    if (result.ready_after_s && result.fixes.size() >= 2 && result.trajectory.size() >= 2) {
      const Pose2& a = result.trajectory.front().pose;
      const Pose2& b = result.trajectory.back().pose;
      const Point2& fa = result.fixes.front();
      const Point2& fb = result.fixes.back();
      result.gnss_gap_m = std::hypot((b.x - a.x) - (fb.x - fa.x), (b.y - a.y) - (fb.y - fa.y));
    }
  }

  FuseResult result;
  std::size_t wheel_messages = 0;

 private:
  void onFix(const GnssFix& fix) {
    if (const auto* geodetic = std::get_if<Geodetic>(&fix.position)) {
      if (fix.type == GnssFixType::kNone) return;
      if (!plane_) {
        plane_.emplace(*geodetic);
        result.datum = *geodetic;
      }
    }
    const Eigen::Vector2d p_map_antenna = antennaInMap(fix, plane_);
    const ekf::UpdateReport report = offerFix(filter_, fix, p_map_antenna);
    result.fixes.push_back({p_map_antenna.x(), p_map_antenna.y()});
    (wasUsed(report) ? result.fixes_accepted : result.fixes_refused) += 1;
    if (report.reason == "reset") ++result.position_resets;
  }

  void output() {
    const PoseWithCovariance T_odom_base = filter_.odometry().pose();
    result.odometry.push_back({filter_.time(), T_odom_base.mean});
    if (filter_.ready()) {
      append(filter_.time(), filter_.pose());
    } else {
      held_back_.push_back({{filter_.time(), T_odom_base.mean}, T_odom_base.cov});
    }
  }

  /// Odometry before the filter was ready gets its place in the map afterwards.
  void placeHeldBack() {
    const auto alignment = filter_.initialAlignment();
    for (const auto& [pose, cov] : held_back_) {
      PoseWithCovariance T_map_base = compose(*alignment, pose.pose);
      T_map_base.cov += compose(alignment->mean, PoseWithCovariance{pose.pose, cov}).cov;
      append(pose.stamp, T_map_base);
    }
    held_back_.clear();
  }

  void append(Timestamp stamp, const PoseWithCovariance& T_map_base) {
    if (!result.trajectory.empty()) {
      result.distance_m += distance(result.trajectory.back().pose, T_map_base.mean);
    }
    result.trajectory.push_back({stamp, T_map_base.mean});
    PoseEvent event;
    event.stamp = stamp;
    event.source = PoseSource::kGnssFilter;
    event.T = T_map_base;
    observers_.emit(event);
  }

  const Observers& observers_;
  ekf::PlanarFilter filter_;
  std::optional<geo::TangentPlane> plane_;
  std::optional<Timestamp> first_;
  std::optional<Timestamp> last_;
  std::vector<std::pair<metrics::TimedPose, Eigen::Matrix3d>> held_back_;
};

}  // namespace

FuseResult fuse(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const Config& config,
    const Observers& observers,
    const Progress& progress) {
  const auto reader = io::openRecording(recording_path, recording_options);
  Fusion fusion(config, observers);
  forEachInStampOrder(
      *reader,
      [&fusion](const Measurement& measurement) { fusion.process(measurement); },
      progress);
  if (fusion.wheel_messages == 0) {
    throw InputError(
        recording_path + ": no wheel odometry in it, which the filter needs (see vestibule info)");
  }
  fusion.finish();
  fusion.result.notes = reader->notes();
  return std::move(fusion.result);
}

}  // namespace vestibule::pipeline
