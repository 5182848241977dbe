#include "vestibule/gui_headless/run_recorder.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::gui_headless {

RunRecorder::RunRecorder(const RecorderLimits& limits) : limits_(limits) {}

void RunRecorder::see(Timestamp stamp) {
  if (!span_) {
    span_.emplace(stamp, stamp);
    return;
  }
  span_->first = std::min(span_->first, stamp);
  span_->second = std::max(span_->second, stamp);
}

void RunRecorder::onPose(const PoseEvent& event) {
  if (!isFinite(event.T.mean)) return;
  see(event.stamp);
  Track& track = tracks_[static_cast<std::size_t>(event.source)];
  const PoseSample sample{event.stamp, event.mode, event.T};
  if (track.last) track.distance_m += distance(track.last->T.mean, sample.T.mean);
  track.last = sample;
  if (track.samples.next()) track.samples.keep(sample, limits_.max_poses);
}

void RunRecorder::onUpdate(const UpdateEvent& event) {
  see(event.stamp);
  SensorUpdates& sensor = updates_[event.sensor];
  ++sensor.counts[static_cast<std::size_t>(event.decision)];
  const bool refused = event.decision == Decision::kGated || event.decision == Decision::kRejected;
  if (refused) ++sensor.refusals[event.reason];
  if (event.dof <= 0 || !std::isfinite(event.nis)) return;
  if (sensor.samples.next()) {
    sensor.samples.keep(
        {event.stamp, event.nis, event.gate, event.dof, event.decision}, limits_.max_updates);
  }
}

namespace {

/// One sigma of the particles' position [m].
double spreadOf(const ParticlesEvent& event) {
  const std::size_t n = event.T_map_particles.size();
  if (n == 0 || event.weights.size() != n) return 0.0;
  const Pose2& origin = event.T_map_particles.front();
  double x = 0.0;
  double y = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const double dx = event.T_map_particles[i].x - origin.x;
    const double dy = event.T_map_particles[i].y - origin.y;
    x += event.weights[i] * dx;
    y += event.weights[i] * dy;
    squares += event.weights[i] * (dx * dx + dy * dy);
  }
  return std::sqrt(std::max(0.0, squares - x * x - y * y));
}

}  // namespace

ParticleSnapshot RunRecorder::snapshotOf(const ParticlesEvent& event) const {
  const std::size_t n = event.T_map_particles.size();
  ParticleSnapshot snapshot;
  snapshot.stamp = event.stamp;
  snapshot.count = n;
  snapshot.spread_m = spreadOf(event);
  snapshot.lost_probability = event.lost_probability;
  snapshot.p_map_unmapped = event.p_map_unmapped;
  if (n <= limits_.max_particles || event.weights.size() != n) {
    const auto end = event.T_map_particles.begin() +
                     static_cast<std::ptrdiff_t>(std::min(n, limits_.max_particles));
    snapshot.T_map_particles.assign(event.T_map_particles.begin(), end);
    return snapshot;
  }
  // Systematic sampling: evenly spaced pointers over the cumulative weights, without random
  // numbers.
  snapshot.T_map_particles.reserve(limits_.max_particles);
  double cumulative = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    cumulative += event.weights[i];
    while (snapshot.T_map_particles.size() < limits_.max_particles &&
           (static_cast<double>(snapshot.T_map_particles.size()) + 0.5) /
                   static_cast<double>(limits_.max_particles) <
               cumulative) {
      snapshot.T_map_particles.push_back(event.T_map_particles[i]);
    }
  }
  return snapshot;
}

void RunRecorder::onParticles(const ParticlesEvent& event) {
  if (event.T_map_particles.empty()) return;
  see(event.stamp);
  last_snapshot_ = snapshotOf(event);
  if (particle_samples_.next()) {
    particle_samples_.keep(
        {event.stamp,
         last_snapshot_->count,
         last_snapshot_->spread_m,
         event.inlier_share,
         event.lost_probability},
        limits_.max_particle_samples);
  }
  if (snapshots_.next()) snapshots_.keep(*last_snapshot_, limits_.max_snapshots);
}

void RunRecorder::onPlaces(const PlacesEvent& event) {
  see(event.stamp);
  if (places_events_.size() < limits_.max_events) {
    places_events_.push_back(event);
  } else {
    ++events_not_kept_;
  }
}

void RunRecorder::onMode(const ModeEvent& event) {
  see(event.stamp);
  if (mode_events_.size() < limits_.max_events) {
    mode_events_.push_back(event);
  } else {
    ++events_not_kept_;
  }
}

void RunRecorder::onMap(const MapEvent& event) {
  see(event.stamp);
  if (map_events_.size() < limits_.max_events) {
    map_events_.push_back(event);
  } else {
    ++events_not_kept_;
  }
}

void RunRecorder::onMission(const MissionEvent& event) {
  see(event.stamp);
  if (mission_events_.size() < limits_.max_events) {
    mission_events_.push_back(event);
  } else {
    ++events_not_kept_;
  }
}

void RunRecorder::onWarning(const WarningEvent& event) {
  see(event.stamp);
  const auto same = std::find_if(warnings_.begin(), warnings_.end(), [&](const auto& w) {
    return w.component == event.component && w.text == event.text;
  });
  if (same != warnings_.end()) {
    ++same->count;
    same->last = event.stamp;
  } else if (warnings_.size() < limits_.max_warnings) {
    warnings_.push_back(
        {event.component, event.text, event.stamp, event.stamp, 1, event.value, event.limit});
  } else {
    ++events_not_kept_;
  }
}

std::vector<PoseSample> RunRecorder::poses(PoseSource source) const {
  const Track& chosen = track(source);
  std::vector<PoseSample> all = chosen.samples.kept;
  const bool last_was_thinned_out = chosen.last && chosen.samples.seen > 0 &&
                                    (chosen.samples.seen - 1) % chosen.samples.stride != 0;
  if (last_was_thinned_out) all.push_back(*chosen.last);
  return all;
}

std::optional<PoseSource> RunRecorder::primarySource() const {
  for (const PoseSource source :
       {PoseSource::kPublished, PoseSource::kParticles, PoseSource::kGnssFilter}) {
    if (track(source).last) return source;
  }
  return std::nullopt;
}

std::vector<PoseSample> RunRecorder::primaryPoses() const {
  const auto source = primarySource();
  return source ? poses(*source) : std::vector<PoseSample>{};
}

double RunRecorder::distanceTravelled() const {
  const auto source = primarySource();
  return source ? track(*source).distance_m : 0.0;
}

std::size_t RunRecorder::posesSeen(PoseSource source) const { return track(source).samples.seen; }

std::vector<ParticleSnapshot> RunRecorder::snapshots() const {
  std::vector<ParticleSnapshot> all = snapshots_.kept;
  if (last_snapshot_ && (snapshots_.seen - 1) % snapshots_.stride != 0) {
    all.push_back(*last_snapshot_);
  }
  return all;
}

std::optional<std::pair<Timestamp, Timestamp>> RunRecorder::span() const { return span_; }

std::vector<ModeSpan> modeSpans(const RunRecorder& run) {
  std::vector<ModeSpan> spans;
  if (!run.span()) return spans;
  const auto [start, end] = *run.span();
  if (!run.modeEvents().empty()) {
    spans.push_back({start, start, run.modeEvents().front().from, ""});
    for (const ModeEvent& event : run.modeEvents()) {
      spans.back().to = event.stamp;
      spans.push_back({event.stamp, event.stamp, event.to, event.reason});
    }
    // A run that begins with a mode event has nothing before it.
    if (spans.front().to <= spans.front().from) spans.erase(spans.begin());
  } else {
    for (const PoseSample& sample : run.primaryPoses()) {
      if (!spans.empty() && spans.back().mode == sample.mode) continue;
      if (!spans.empty()) spans.back().to = sample.stamp;
      spans.push_back({spans.empty() ? start : sample.stamp, sample.stamp, sample.mode, ""});
    }
  }
  if (!spans.empty()) spans.back().to = end;
  return spans;
}

}  // namespace vestibule::gui_headless
