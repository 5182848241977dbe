#include "vestibule/mode_manager/pose_slewer.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule::mode_manager {

void PoseSlewer::start(Timestamp stamp, const Pose2& T_map_odom_target) {
  last_ = stamp;
  T_map_odom_ = T_map_odom_target;
  pending_ = {};
}

void PoseSlewer::step(Timestamp stamp, const Pose2& T_odom_base, const Pose2& T_map_odom_target) {
  const double dt_s = std::max(0.0, toSeconds(stamp - *last_));
  last_ = std::max(*last_, stamp);
  const Pose2 target = compose(T_map_odom_target, T_odom_base);
  Pose2 base = compose(T_map_odom_, T_odom_base);
  const double ex = target.x - base.x;
  const double ey = target.y - base.y;
  const double eyaw = angleDiff(target.phi, base.phi);

  const double share = 1.0 - std::exp(-dt_s / params_.time_constant_s);
  const double e = std::hypot(ex, ey);
  const double move = std::min(share * e, params_.max_mps * dt_s);
  const double factor = e > 0.0 ? move / e : 0.0;
  const double max_turn = params_.max_radps * dt_s;
  const double turn = std::clamp(share * eyaw, -max_turn, max_turn);

  base = {base.x + factor * ex, base.y + factor * ey, wrapToPi(base.phi + turn)};
  T_map_odom_ = compose(base, inverse(T_odom_base));
  pending_ = {(1.0 - factor) * ex, (1.0 - factor) * ey, eyaw - turn};
}

void PoseSlewer::hold(Timestamp stamp) {
  last_ = std::max(*last_, stamp);
  pending_ = {};
}

}  // namespace vestibule::mode_manager
