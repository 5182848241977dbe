#pragma once

#include <optional>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/core/time.hpp"

namespace vestibule::sim {

/// One part of a scripted drive; exactly one of `to`, `turn_to_rad`, `wait_s` and `twist` is set.
struct Leg {
  std::optional<Point2> to;              ///< straight there, map frame [m]
  std::optional<double> turn_to_rad;     ///< on the spot to this yaw
  std::optional<double> wait_s;          ///< stand still
  std::optional<Eigen::Vector2d> twist;  ///< v [m/s], omega [rad/s], held for `for_s`
  double for_s = 0.0;
  double speed_mps = 0.8;  ///< along `to`
  bool reverse = false;    ///< along `to`, backwards
};
void describe(ParamIo& io, Leg& leg);

struct VelocityCommand {
  double v_mps = 0.0;
  double omega_radps = 0.0;
};

/// Drives legs with perfect knowledge of the pose, so that the drive of a scenario is the same
/// whatever an estimator makes of its data: pursuit of a point ahead on the line (Coulter 1992),
/// turning on the spot first where the corner is sharp.
class RouteFollower {
 public:
  /// \param turns_on_the_spot false for cars: they take corners while rolling
  RouteFollower(std::vector<Leg> legs, const Pose2& T_map_base, bool turns_on_the_spot);

  /// \pre calls are `dt` apart
  [[nodiscard]] VelocityCommand step(const Pose2& T_map_base, Duration dt);
  [[nodiscard]] bool finished() const { return next_ >= legs_.size(); }
  /// Share of the legs that are done.
  [[nodiscard]] double progress() const {
    return legs_.empty() ? 0.0 : static_cast<double>(next_) / static_cast<double>(legs_.size());
  }

 private:
  [[nodiscard]] VelocityCommand alongLine(const Leg& leg, const Pose2& T_map_base);
  void nextLeg(const Pose2& T_map_base);

  std::vector<Leg> legs_;
  bool turns_on_the_spot_;
  std::size_t next_ = 0;
  Point2 leg_start_;
  bool turning_ = false;
  double leg_s_ = 0.0;
};

}  // namespace vestibule::sim
