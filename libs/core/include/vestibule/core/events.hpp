#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"

namespace vestibule {

/// Who says where the robot is.
enum class PoseSource {
  kOdometry,    ///< T_odom_base, smooth
  kGnssFilter,  ///< T_map_base of the GNSS/IMU/wheel filter
  kParticles,   ///< T_map_base of the particle localization
  kPublished,   ///< T_map_base as the rest of the robot sees it
  kTruth        ///< T_map_base of the simulator or a reference
};

/// Which estimator has authority over T_map_odom.
enum class Mode { kOutdoor, kIndoor, kDeadReckoning, kLost };

/// What became of a measurement.
enum class Decision { kAccepted, kDownWeighted, kGated, kRejected };

[[nodiscard]] std::string_view toString(PoseSource source);
[[nodiscard]] std::string_view toString(Mode mode);
[[nodiscard]] std::string_view toString(Decision decision);

/// A pose estimate. `T.cov` is in the axes of the pose's own parent frame.
struct PoseEvent {
  Timestamp stamp;
  PoseSource source = PoseSource::kPublished;
  Mode mode = Mode::kOutdoor;
  PoseWithCovariance T;
};

/// One measurement offered to a filter. `nis` is n' S^-1 n with `dof` degrees of freedom; `gate`
/// the limit it was held against (same unit), both before any down-weighting.
struct UpdateEvent {
  Timestamp stamp;
  std::string sensor;  ///< "gnss", "heading", ...
  Decision decision = Decision::kAccepted;
  std::string reason;  ///< one or two words: "chi2", "fix type", "stale"
  double nis = 0.0;
  double gate = 0.0;
  int dof = 0;
};

/// State of the particle set after a scan, in the map frame. The referenced vectors live only for
/// the duration of the call.
struct ParticlesEvent {
  Timestamp stamp;
  const std::vector<Pose2>& T_map_particles;
  const std::vector<double>& weights;  ///< normalised, sum 1
  double effective_sample_size = 0.0;
  double inlier_share = 0.0;  ///< share of valid beams ending near a mapped obstacle
  double lost_probability = 0.0;
  std::vector<Point2> p_map_unmapped = {};  ///< beam ends far from every mapped obstacle
};

/// Where a search of the map says the robot may be.
struct PlacesEvent {
  Timestamp stamp;
  std::string state;                             ///< "nowhere", "unsure", "sure"
  std::vector<std::pair<Pose2, double>> places;  ///< T_map_base and weight, best first
  int searches = 0;                              ///< of the map, so far
};

/// A change of authority, with the numbers behind it.
struct ModeEvent {
  Timestamp stamp;
  Mode from = Mode::kOutdoor;
  Mode to = Mode::kOutdoor;
  std::string reason;
  std::vector<std::pair<std::string, double>> values;
};

/// An indoor map comes into memory or leaves it.
struct MapEvent {
  enum class Kind { kLoaded, kUnloaded };
  Timestamp stamp;
  Kind kind = Kind::kLoaded;
  std::string map;
  double distance_m = 0.0;  ///< of the robot from the map's rectangle
};
[[nodiscard]] std::string_view toString(MapEvent::Kind kind);

/// Progress of a mission.
struct MissionEvent {
  enum class Kind { kPathStarted, kWaypointReached, kTaskStarted, kTaskDone, kDone, kAborted };
  Timestamp stamp;
  Kind kind = Kind::kPathStarted;
  std::string path;
  std::string waypoint;
  std::string text;
};
[[nodiscard]] std::string_view toString(MissionEvent::Kind kind);

/// Something a person can act on.
struct WarningEvent {
  Timestamp stamp;
  std::string component;
  std::string text;
  double value = 0.0;
  double limit = 0.0;
};

/// Looks on; changes nothing. Results are identical with none attached.
class Observer {
 public:
  Observer() = default;
  Observer(const Observer&) = delete;
  Observer& operator=(const Observer&) = delete;
  virtual ~Observer() = default;

  virtual void onPose(const PoseEvent& /*event*/) {}
  virtual void onUpdate(const UpdateEvent& /*event*/) {}
  virtual void onParticles(const ParticlesEvent& /*event*/) {}
  virtual void onPlaces(const PlacesEvent& /*event*/) {}
  virtual void onMode(const ModeEvent& /*event*/) {}
  virtual void onMap(const MapEvent& /*event*/) {}
  virtual void onMission(const MissionEvent& /*event*/) {}
  virtual void onWarning(const WarningEvent& /*event*/) {}
};

/// Hands each event to the attached observers, in the order they were attached.
/// Does not own them: an observer outlives the list.
class Observers {
 public:
  void attach(Observer& observer) { observers_.push_back(&observer); }

  void emit(const PoseEvent& event) const;
  void emit(const UpdateEvent& event) const;
  void emit(const ParticlesEvent& event) const;
  void emit(const PlacesEvent& event) const;
  void emit(const ModeEvent& event) const;
  void emit(const MapEvent& event) const;
  void emit(const MissionEvent& event) const;
  void emit(const WarningEvent& event) const;

 private:
  std::vector<Observer*> observers_;
};

}  // namespace vestibule
