#pragma once

#include <iosfwd>

#include "vestibule/core/events.hpp"

namespace vestibule::io {

/// Writes events as JSON Lines: one object per line with "t" (exact decimal seconds, as text),
/// "type" and the event's fields, numbers in a fixed format. Particle sets appear as their count
/// and quality. Poses are left out: trajectory.tum has them.
class EventLog : public Observer {
 public:
  /// \param out  outlives the log
  explicit EventLog(std::ostream& out) : out_(out) {}

  void onUpdate(const UpdateEvent& event) override;
  void onParticles(const ParticlesEvent& event) override;
  void onPlaces(const PlacesEvent& event) override;
  void onMode(const ModeEvent& event) override;
  void onMap(const MapEvent& event) override;
  void onMission(const MissionEvent& event) override;
  void onWarning(const WarningEvent& event) override;

 private:
  std::ostream& out_;
};

}  // namespace vestibule::io
