#include "vestibule/core/events.hpp"

namespace vestibule {

std::string_view toString(PoseSource source) {
  switch (source) {
    case PoseSource::kOdometry:
      return "odometry";
    case PoseSource::kGnssFilter:
      return "gnss_filter";
    case PoseSource::kParticles:
      return "particles";
    case PoseSource::kPublished:
      return "published";
    case PoseSource::kTruth:
      return "truth";
  }
  return "?";
}

std::string_view toString(Mode mode) {
  switch (mode) {
    case Mode::kOutdoor:
      return "outdoor";
    case Mode::kIndoor:
      return "indoor";
    case Mode::kDeadReckoning:
      return "dead_reckoning";
    case Mode::kLost:
      return "lost";
  }
  return "?";
}

std::string_view toString(Decision decision) {
  switch (decision) {
    case Decision::kAccepted:
      return "accepted";
    case Decision::kDownWeighted:
      return "down_weighted";
    case Decision::kGated:
      return "gated";
    case Decision::kRejected:
      return "rejected";
  }
  return "?";
}

std::string_view toString(MapEvent::Kind kind) {
  switch (kind) {
    case MapEvent::Kind::kLoaded:
      return "loaded";
    case MapEvent::Kind::kUnloaded:
      return "unloaded";
  }
  return "?";
}

std::string_view toString(MissionEvent::Kind kind) {
  switch (kind) {
    case MissionEvent::Kind::kPathStarted:
      return "path_started";
    case MissionEvent::Kind::kWaypointReached:
      return "waypoint_reached";
    case MissionEvent::Kind::kTaskStarted:
      return "task_started";
    case MissionEvent::Kind::kTaskDone:
      return "task_done";
    case MissionEvent::Kind::kDone:
      return "done";
    case MissionEvent::Kind::kAborted:
      return "aborted";
  }
  return "?";
}

void Observers::emit(const PoseEvent& event) const {
  for (Observer* observer : observers_) observer->onPose(event);
}
void Observers::emit(const UpdateEvent& event) const {
  for (Observer* observer : observers_) observer->onUpdate(event);
}
void Observers::emit(const ParticlesEvent& event) const {
  for (Observer* observer : observers_) observer->onParticles(event);
}
void Observers::emit(const PlacesEvent& event) const {
  for (Observer* observer : observers_) observer->onPlaces(event);
}
void Observers::emit(const ModeEvent& event) const {
  for (Observer* observer : observers_) observer->onMode(event);
}
void Observers::emit(const MapEvent& event) const {
  for (Observer* observer : observers_) observer->onMap(event);
}
void Observers::emit(const MissionEvent& event) const {
  for (Observer* observer : observers_) observer->onMission(event);
}
void Observers::emit(const WarningEvent& event) const {
  for (Observer* observer : observers_) observer->onWarning(event);
}

}  // namespace vestibule
