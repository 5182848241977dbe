#include "vestibule/sensors/slips.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/core/random.hpp"

namespace vestibule {

namespace {

constexpr double kLongestStep_s = 1.0;  // a longer one is a gap, or stamps that run backwards

}  // namespace

void SlipMaker::apply(WheelOdometry& odometry) {
  const double step_s =
      started_ ? std::clamp(toSeconds(odometry.stamp - last_), 0.0, kLongestStep_s) : 0.0;
  started_ = true;
  last_ = odometry.stamp;
  since_s_ += step_s;
  if (since_s_ >= params_.every_s) {
    since_s_ -= params_.every_s;
    RandomStream random(seed_, "slip", count_++);
    const double direction = random.uniform(-kPi, kPi);
    slip_ = {
        params_.distance_m * std::cos(direction),
        params_.distance_m * std::sin(direction),
        random.uniform(0.0, 1.0) < 0.5 ? params_.turn_rad : -params_.turn_rad};
    left_ = 1.0;
  }
  if (left_ <= 0.0) return;
  const double share = params_.lasts_s > 0.0 ? std::min(left_, step_s / params_.lasts_s) : left_;
  left_ -= share;
  odometry.T_previous_now =
      compose(odometry.T_previous_now, Pose2{share * slip_.x, share * slip_.y, share * slip_.phi});
}

}  // namespace vestibule
