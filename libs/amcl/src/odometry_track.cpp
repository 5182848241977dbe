#include "odometry_track.hpp"

#include <algorithm>

namespace vestibule::amcl {
namespace {

constexpr double kRemembered_s = 3.0;
// A message about a longer time says little of the speed at its end.
constexpr double kLongestPeriod_s = 0.3;

}  // namespace

void OdometryTrack::add(const WheelOdometry& odometry) {
  if (!path_.empty() && odometry.stamp < path_.back().stamp) path_.clear();
  if (path_.empty())
    path_.push_back({odometry.stamp - durationFromSeconds(odometry.dt_s), T_odom_base_});
  T_odom_read_ = compose(T_odom_read_, odometry.T_previous_now);
  T_odom_base_ = T_odom_read_;
  if (odometry.stamp_borrowed) {
    if (!missing_) missing_.emplace();
    missing_->take(odometry.T_previous_now.x, odometry.dt_s);
    // Straight on: how the robot turned meanwhile is not known, and nothing grows with it.
    T_odom_base_ = compose(T_odom_read_, Pose2{missing_->mean_m(), 0.0, 0.0});
  } else {
    missing_.reset();
  }
  path_.push_back({odometry.stamp, T_odom_base_});
  while (toSeconds(odometry.stamp - path_.front().stamp) > kRemembered_s) path_.pop_front();
  const bool tells_speed = odometry.dt_s > 0.0 && odometry.dt_s <= kLongestPeriod_s;
  period_s_ = tells_speed ? odometry.dt_s : 0.0;
  twist_ = tells_speed ? Eigen::Vector3d(logSe2(odometry.T_previous_now) / odometry.dt_s)
                       : Eigen::Vector3d::Zero();
}

Pose2 OdometryTrack::at(Timestamp stamp) const {
  if (path_.empty() || stamp < path_.front().stamp) return T_odom_base_;
  if (stamp >= path_.back().stamp) {
    const double ahead_s = toSeconds(stamp - path_.back().stamp);
    if (ahead_s > 2.0 * period_s_) return T_odom_base_;
    return compose(T_odom_base_, expSe2(twist_ * ahead_s));
  }
  const auto after = std::upper_bound(
      path_.begin(), path_.end(), stamp, [](Timestamp t, const Stamped& s) { return t < s.stamp; });
  const auto before = std::prev(after);
  const double share = toSeconds(stamp - before->stamp) / toSeconds(after->stamp - before->stamp);
  return interpolate(before->T_odom_base, after->T_odom_base, share);
}

}  // namespace vestibule::amcl
