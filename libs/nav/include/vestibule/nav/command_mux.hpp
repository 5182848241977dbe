#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "vestibule/core/params.hpp"
#include "vestibule/nav/driver.hpp"

namespace vestibule::nav {

/// Rectangle around the base origin.
struct Footprint {
  double half_length_m = 0.495;
  double half_width_m = 0.335;
  /// Radius of the circle the corners draw when the robot turns on the spot.
  [[nodiscard]] double radius() const;
  /// From the outline to a point of the base frame [m], negative inside.
  [[nodiscard]] double signedDistance(const Point2& p_base) const;
};
void describe(ParamIo& io, Footprint& footprint);

struct CollisionStopParams {
  double margin_m = 0.15;          ///< [m] no point may come nearer to the footprint than this
  double deceleration_mps2 = 0.6;  ///< [m/s^2] assumed when braking
  double reaction_s = 0.3;         ///< [s] command, wheels and scan period together
};
void describe(ParamIo& io, CollisionStopParams& params);

/// The last word before the wheels, on raw scan points only: slows a command down, or stops it,
/// when the footprint swept over the stopping distance would meet a point. Motion that takes the
/// robot away from a point that is already too near is allowed.
class CollisionStop {
 public:
  CollisionStop(const CollisionStopParams& params, const Footprint& footprint);

  struct Result {
    Command command;
    double scale = 1.0;        ///< 1 = untouched, 0 = stopped
    double clearance_m = 0.0;  ///< of the nearest point now
  };
  [[nodiscard]] Result limit(
      const Command& wanted, const std::vector<Point2>& obstacles_base) const;

 private:
  CollisionStopParams params_;
  Footprint footprint_;
};

struct CommandMuxParams {
  double max_pose_age_s = 0.5;  ///< [s] an older pose stops the robot
  double max_scan_age_s = 0.5;  ///< [s] an older scan stops the robot
  CollisionStopParams collision_stop;
};
void describe(ParamIo& io, CommandMuxParams& params);

enum class CommandSource { kNone, kMission, kRecovery, kEmergencyStop };
[[nodiscard]] std::string_view toString(CommandSource source);

/// Age and validity of what a command was computed from.
struct CommandInputs {
  Timestamp stamp;
  std::optional<Timestamp> pose_stamp;  ///< empty = no valid pose
  std::optional<Timestamp> scan_stamp;  ///< empty = no scan yet
};

/// Picks the command with the highest priority (emergency stop, recovery, mission) and lets it pass
/// the collision stop.
class CommandMux {
 public:
  CommandMux(const CommandMuxParams& params, const Footprint& footprint);

  /// Holds until released; whatever is offered meanwhile is ignored.
  void setEmergencyStop(bool on) { emergency_stop_ = on; }
  [[nodiscard]] bool emergencyStop() const { return emergency_stop_; }

  struct Result {
    Command command;
    CommandSource source = CommandSource::kNone;
    /// Why the command is less than was asked for: "", "emergency stop", "no pose", "stale pose",
    /// "no scan", "stale scan", "not a number", "obstacle".
    std::string_view limit;
    double clearance_m = 0.0;
  };
  [[nodiscard]] Result select(
      const CommandInputs& inputs,
      const std::optional<Command>& mission,
      const std::optional<Command>& recovery,
      const std::vector<Point2>& obstacles_base) const;

 private:
  CommandMuxParams params_;
  CollisionStop collision_stop_;
  bool emergency_stop_ = false;
};

}  // namespace vestibule::nav
