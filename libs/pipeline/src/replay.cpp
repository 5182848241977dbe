#include "vestibule/pipeline/replay.hpp"

#include <algorithm>
#include <cstddef>

#include "vestibule/core/errors.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/pipeline/gnss_input.hpp"
#include "vestibule/pipeline/seamless_estimator.hpp"
#include "vestibule/pipeline/time_ordered_queue.hpp"

namespace vestibule::pipeline {
namespace {

/// One recording on its way through the estimator.
class Replay : public Observer {
 public:
  Replay(
      const Config& config,
      const geo::Site& site,
      const std::optional<Pose2>& T_map_base_init,
      const Observers& observers)
      : plane_(site.datum),
        init_(T_map_base_init),
        observers_(withSelf(observers)),
        estimator_(config, site, surveyIndoorMaps(site, &result.notes), observers_) {}

  void process(const Measurement& measurement) {
    const Timestamp stamp = stampOf(measurement);
    if (!first_) {
      first_ = stamp;
      if (init_) estimator_.start(stamp, toldStart(*init_));
    }
    last_ = last_ ? std::max(*last_, stamp) : stamp;
    if (const auto* fix = std::get_if<GnssFix>(&measurement)) keepForPicture(*fix);
    estimator_.process(measurement);
    if (std::holds_alternative<WheelOdometry>(measurement)) {
      ++wheel_messages;
      output();
    }
  }

  void finish() {
    result.data_s = first_ ? toSeconds(*last_ - *first_) : 0.0;
    result.waiting_for = estimator_.waitingFor();
    result.final_mode = estimator_.modeManager().mode();
    result.correction = metrics::largestCorrection(result.published, result.odometry);
    for (double& share : result.share_in_mode) {
      share /= std::max<double>(1.0, static_cast<double>(result.published.size()));
    }
  }

  void onMode(const ModeEvent& event) override {
    if (event.from != event.to) ++result.mode_switches;
  }
  void onMap(const MapEvent& event) override { result.map_changes.count(event); }

  ReplayResult result;
  std::size_t wheel_messages = 0;

 private:
  Observers withSelf(Observers observers) {
    observers.attach(*this);
    return observers;
  }

  void keepForPicture(const GnssFix& fix) {
    if (fix.type == GnssFixType::kNone) return;
    const Eigen::Vector3d p_map = antennaInMap(fix, plane_);
    if (p_map.allFinite()) result.fixes.push_back({p_map.x(), p_map.y()});
  }

  void output() {
    const Timestamp stamp = estimator_.time();
    // A message that came too late moved nothing.
    if (!estimator_.ready()) return;
    if (!result.published.empty() && stamp <= result.published.back().stamp) return;
    if (!result.ready_after_s) result.ready_after_s = toSeconds(stamp - *first_);
    const Pose2 T_map_base = estimator_.modeManager().published().mean;
    if (!result.published.empty()) {
      result.distance_m += distance(result.published.back().pose, T_map_base);
    }
    result.published.push_back({stamp, T_map_base});
    result.odometry.push_back({stamp, estimator_.T_odom_base()});
    result.share_in_mode[static_cast<std::size_t>(estimator_.modeManager().mode())] += 1.0;
  }

  std::optional<geo::TangentPlane> plane_;
  std::optional<Pose2> init_;
  Observers observers_;
  SeamlessEstimator estimator_;
  std::optional<Timestamp> first_;
  std::optional<Timestamp> last_;
};

}  // namespace

ReplayResult replay(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const geo::Site& site,
    const std::optional<Pose2>& T_map_base_init,
    const Config& config,
    const Observers& observers,
    const Progress& progress) {
  const auto reader = io::openRecording(recording_path, recording_options);
  Replay replay(config, site, T_map_base_init, observers);
  forEachInStampOrder(
      *reader,
      [&replay](const Measurement& measurement) { replay.process(measurement); },
      progress);
  if (replay.wheel_messages == 0) {
    throw InputError(
        recording_path +
        ": no wheel odometry in it, which the estimator needs (see vestibule info)");
  }
  replay.finish();
  const std::vector<std::string> notes = reader->notes();
  replay.result.notes.insert(replay.result.notes.end(), notes.begin(), notes.end());
  return std::move(replay.result);
}

}  // namespace vestibule::pipeline
