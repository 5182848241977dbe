#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/nav/mission.hpp"

namespace vestibule::nav {

/// Velocity of the base: forward [m/s], counter-clockwise [rad/s].
struct Command {
  double v_mps = 0.0;
  double omega_radps = 0.0;
};

enum class DriverState { kIdle, kDriving, kArrived, kBlocked };

struct DriverStatus {
  Command command;
  DriverState state = DriverState::kIdle;
  std::size_t waypoints_reached = 0;  ///< of the goals last set, in their order
  std::string reason;                 ///< why it is blocked
};

/// Local control: drives through waypoints around whatever the lidar sees.
class Driver {
 public:
  Driver() = default;
  Driver(const Driver&) = delete;
  Driver& operator=(const Driver&) = delete;
  virtual ~Driver() = default;

  /// Replaces all goals. They are to be passed in this order; the robot stops at the last one and
  /// turns to its yaw if it has one.
  virtual void setGoals(const std::vector<Waypoint>& goals) = 0;

  /// \param v_mps, omega_radps  present velocity of the base
  /// \param obstacles_base      what stands around the robot, in the base frame
  [[nodiscard]] virtual DriverStatus step(
      Timestamp stamp,
      const Pose2& T_map_base,
      double v_mps,
      double omega_radps,
      const std::vector<Point2>& obstacles_base) = 0;

  /// Forgets the goals.
  virtual void stop() = 0;
};

}  // namespace vestibule::nav
