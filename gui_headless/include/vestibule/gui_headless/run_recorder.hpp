#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "vestibule/core/events.hpp"
#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"

namespace vestibule::gui_headless {

/// Upper bounds of what a recorder keeps, so that a day-long run costs as much as a short one.
struct RecorderLimits {
  std::size_t max_poses = 16384;    ///< per source; thinned evenly beyond
  std::size_t max_snapshots = 12;   ///< of the particle set, besides the first and the last
  std::size_t max_particles = 400;  ///< per snapshot, drawn in proportion to their weights
  std::size_t max_particle_samples = 8192;
  std::size_t max_updates = 8192;  ///< NIS samples per sensor; thinned evenly beyond
  std::size_t max_events = 1000;   ///< of modes, maps, missions each; later ones only counted
  std::size_t max_warnings = 200;  ///< different warnings; repeats of one are only counted
};

struct PoseSample {
  Timestamp stamp;
  Mode mode = Mode::kOutdoor;
  PoseWithCovariance T;  ///< T_map_base, T_odom_base for odometry
};

struct ParticleSnapshot {
  Timestamp stamp;
  std::vector<Pose2> T_map_particles;
  std::size_t count = 0;  ///< of all particles, before thinning
  double spread_m = 0.0;  ///< one sigma of their position
  double lost_probability = 0.0;
  std::vector<Point2> p_map_unmapped;  ///< beam ends on things that are not in the map
};

/// The particle set in numbers.
struct ParticleSample {
  Timestamp stamp;
  std::size_t count = 0;
  double spread_m = 0.0;
  double inlier_share = 0.0;
  double lost_probability = 0.0;
};

struct NisSample {
  Timestamp stamp;
  double nis = 0.0;
  double gate = 0.0;
  int dof = 0;
  Decision decision = Decision::kAccepted;
};

/// A series of bounded length: every stride-th value is kept, and when it is full every second one
/// is dropped and the stride doubled. The first value always stays.
template <class T>
struct Thinned {
  std::vector<T> kept;
  std::size_t seen = 0;
  std::size_t stride = 1;

  /// Counts one more value; true when it should be handed to keep().
  bool next() { return seen++ % stride == 0; }
  void keep(T value, std::size_t max_size) {
    kept.push_back(std::move(value));
    if (kept.size() <= max_size) return;
    std::size_t n = 0;
    for (std::size_t i = 0; i < kept.size(); i += 2, ++n) {
      if (i != n) kept[n] = std::move(kept[i]);
    }
    kept.resize(n);
    stride *= 2;
  }
};

struct SensorUpdates {
  std::array<std::size_t, 4> counts{};          ///< indexed by Decision
  std::map<std::string, std::size_t> refusals;  ///< reasons of gated and rejected ones
  Thinned<NisSample> samples;                   ///< dof > 0 and finite nis only

  [[nodiscard]] std::size_t count(Decision decision) const {
    return counts[static_cast<std::size_t>(decision)];
  }
  [[nodiscard]] std::size_t total() const { return counts[0] + counts[1] + counts[2] + counts[3]; }
};

/// One kind of warning (component and text) with its repeats.
struct WarningSummary {
  std::string component;
  std::string text;
  Timestamp first;
  Timestamp last;
  std::size_t count = 0;
  double value = 0.0;  ///< of the first one
  double limit = 0.0;
};

/// Keeps what the pictures and the report need of a run, in bounded memory. Thinning keeps every
/// 2^n-th sample, so the result depends only on the events, never on time.
class RunRecorder : public Observer {
 public:
  explicit RunRecorder(const RecorderLimits& limits = {});

  void onPose(const PoseEvent& event) override;
  void onUpdate(const UpdateEvent& event) override;
  void onParticles(const ParticlesEvent& event) override;
  void onPlaces(const PlacesEvent& event) override;
  void onMode(const ModeEvent& event) override;
  void onMap(const MapEvent& event) override;
  void onMission(const MissionEvent& event) override;
  void onWarning(const WarningEvent& event) override;

  /// In order of arrival; poses with NaN are dropped.
  [[nodiscard]] std::vector<PoseSample> poses(PoseSource source) const;
  /// The estimate a reader cares about: published, else particles, else the GNSS filter. Empty
  /// when none of them was seen (odometry is not in the map frame).
  [[nodiscard]] std::optional<PoseSource> primarySource() const;
  /// poses(primarySource()), empty when there is none.
  [[nodiscard]] std::vector<PoseSample> primaryPoses() const;
  /// Metres driven along the published (primary) poses as they were emitted, before thinning.
  [[nodiscard]] double distanceTravelled() const;
  [[nodiscard]] std::size_t posesSeen(PoseSource source) const;

  /// First, evenly chosen, last.
  [[nodiscard]] std::vector<ParticleSnapshot> snapshots() const;
  [[nodiscard]] const std::vector<ParticleSample>& particleSamples() const {
    return particle_samples_.kept;
  }
  [[nodiscard]] const std::map<std::string, SensorUpdates>& updates() const { return updates_; }
  [[nodiscard]] const std::vector<ModeEvent>& modeEvents() const { return mode_events_; }
  /// What the searches of the map said, in order.
  [[nodiscard]] const std::vector<PlacesEvent>& placesEvents() const { return places_events_; }
  [[nodiscard]] const std::vector<MapEvent>& mapEvents() const { return map_events_; }
  [[nodiscard]] const std::vector<MissionEvent>& missionEvents() const { return mission_events_; }
  [[nodiscard]] const std::vector<WarningSummary>& warnings() const { return warnings_; }
  /// Events of modes, maps and missions and kinds of warnings beyond the limits.
  [[nodiscard]] std::size_t eventsNotKept() const { return events_not_kept_; }

  /// Earliest and latest stamp of any event; empty before the first.
  [[nodiscard]] std::optional<std::pair<Timestamp, Timestamp>> span() const;

 private:
  struct Track {
    Thinned<PoseSample> samples;
    std::optional<PoseSample> last;  ///< always shown, whatever the thinning
    double distance_m = 0.0;
  };

  void see(Timestamp stamp);
  [[nodiscard]] ParticleSnapshot snapshotOf(const ParticlesEvent& event) const;
  [[nodiscard]] const Track& track(PoseSource source) const {
    return tracks_[static_cast<std::size_t>(source)];
  }

  RecorderLimits limits_;
  std::array<Track, 5> tracks_;
  Thinned<ParticleSnapshot> snapshots_;
  std::optional<ParticleSnapshot> last_snapshot_;
  Thinned<ParticleSample> particle_samples_;
  std::map<std::string, SensorUpdates> updates_;
  std::vector<ModeEvent> mode_events_;
  std::vector<PlacesEvent> places_events_;
  std::vector<MapEvent> map_events_;
  std::vector<MissionEvent> mission_events_;
  std::vector<WarningSummary> warnings_;
  std::size_t events_not_kept_ = 0;
  std::optional<std::pair<Timestamp, Timestamp>> span_;
};

/// A stretch of time under one mode.
struct ModeSpan {
  Timestamp from;
  Timestamp to;
  Mode mode = Mode::kOutdoor;
  std::string reason;  ///< why it began; empty for the first
};

/// The run cut at its mode changes: from the mode events, or from the poses' modes without any.
[[nodiscard]] std::vector<ModeSpan> modeSpans(const RunRecorder& run);

}  // namespace vestibule::gui_headless
