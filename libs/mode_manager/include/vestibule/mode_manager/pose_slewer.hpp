#pragma once

#include <optional>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/mode_manager/params.hpp"

namespace vestibule::mode_manager {

/// Owns the published T_map_odom and moves it towards what the estimator in authority says, so
/// that the base pose never steps. The error is taken and slewed at the base, not at the origin of
/// a transform: half a degree turned about an origin 100 m away would be a jump of 0.9 m.
class PoseSlewer {
 public:
  explicit PoseSlewer(const SlewParams& params) : params_(params) {}

  /// Starts at the target without slewing.
  void start(Timestamp stamp, const Pose2& T_map_odom_target);
  [[nodiscard]] bool started() const { return last_.has_value(); }

  /// Advances to `stamp`. The published base pose moves towards T_map_odom_target * T_odom_base by
  /// at most max_mps and max_radps times the time passed, with the time constant.
  void step(Timestamp stamp, const Pose2& T_odom_base, const Pose2& T_map_odom_target);
  /// Advances the clock without any correction: no estimator has authority.
  void hold(Timestamp stamp);

  [[nodiscard]] const Pose2& T_map_odom() const { return T_map_odom_; }
  /// What is still to be corrected at the base, in map axes: target minus published.
  [[nodiscard]] const Pose2& pending() const { return pending_; }

 private:
  SlewParams params_;
  std::optional<Timestamp> last_;
  Pose2 T_map_odom_;
  Pose2 pending_;
};

}  // namespace vestibule::mode_manager
