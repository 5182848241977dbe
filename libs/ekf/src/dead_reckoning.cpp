#include "dead_reckoning.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::ekf {
namespace {

/// A robot's speed and turn rate change within about this time [s]. Sampled more rarely, a rate
/// says little of what lay between its samples.
constexpr double kMotionTime_s = 0.2;
constexpr double kChangeMemory = 0.8;
/// Turn of a robot whose wheels stand and whose gyro is quiet [rad/sqrt(s)].
constexpr double kStandingTurn = 1e-4;
/// Time over which the vertical is averaged [s]: long against manoeuvres, short against slopes.
constexpr double kVerticalTime_s = 10.0;
constexpr double kGravity = 9.81;
/// A mean specific force further from gravity than this [m/s^2] is not a full accelerometer's.
constexpr double kGravityTolerance = 2.0;

double squared(double v) { return v * v; }

/// Variance of the integral over `dt_s` of a rate of which only both ends are known; `change_sq` is
/// the squared difference of the ends. Rare samples look like white noise: they differ by twice
/// their variance, and the integral has that variance times dt^2. Frequent ones see it all.
double samplingVariance(double change_sq, double dt_s) {
  return 0.5 * change_sq * squared(dt_s * dt_s / (dt_s + kMotionTime_s));
}

}  // namespace

double DeadReckoning::rate() const { return rateIsGyro() ? gyro_rate_ : wheel_rate_; }

bool DeadReckoning::wheelsAlive(Timestamp stamp) const {
  return last_wheels_ && toSeconds(stamp - *last_wheels_) <=
                             std::max(params_.wheels.max_gap_s, 2.5 * wheel_period_s_);
}

bool DeadReckoning::gyroAlive(Timestamp stamp) const {
  return last_imu_ &&
         toSeconds(stamp - *last_imu_) <= std::max(params_.gyro.max_gap_s, 2.5 * imu_period_s_);
}

bool DeadReckoning::standstill() const {
  return still_since_ && toSeconds(time_ - *still_since_) >= params_.standstill_s &&
         wheelsAlive(time_) && (gyro_still_ || !gyroAlive(time_));
}

void DeadReckoning::start(Timestamp stamp) {
  if (started_) return;
  started_ = true;
  time_ = stamp;
}

void DeadReckoning::addNoise(Motion& u) const {
  const double path_m = std::hypot(u.forward_m, u.left_m);
  u.forward_var += squared(params_.wheels.distance_sigma_sqrt_m) * path_m;
  u.left_var += squared(params_.wheels.lateral_sigma_sqrt_m) * path_m;
  if (u.turn_is_gyro) {
    u.turn_var += squared(params_.gyro.noise_rad_sqrt_s) * u.dt_s +
                  squared(params_.gyro.scale_sigma * u.turn_rad);
  } else if (standstill()) {
    u.turn_var += squared(kStandingTurn) * u.dt_s;
  } else {
    u.turn_var += squared(params_.wheels.yaw_sigma_per_rad) * std::abs(u.turn_rad) +
                  squared(params_.wheels.yaw_sigma_sqrt_m) * path_m;
  }
  u.gyro_bias_var = squared(params_.gyro.bias_walk_radps_sqrt_s) * u.dt_s;
  u.wheel_scale_var = squared(params_.wheels.scale_walk_sqrt_m) * path_m;
  u.heading_offset_var = squared(params_.heading.offset_walk_rad_sqrt_s) * u.dt_s;
  u.disturbance_decay = std::exp(-u.dt_s / params_.heading.disturbance_time_s);
  u.disturbance_var =
      squared(params_.heading.disturbance_sigma_rad) * (1.0 - squared(u.disturbance_decay));
}

Motion DeadReckoning::advance(Timestamp stamp) {
  start(stamp);
  Motion u;
  u.dt_s = toSeconds(stamp - time_);
  if (wheelsAlive(stamp)) {
    u.forward_m = speed_forward_ * u.dt_s;
    u.left_m = speed_left_ * u.dt_s;
  } else {
    u.forward_var = squared(params_.wheels.dropout_speed_sigma_mps) * u.dt_s;
    u.left_var = 0.1 * u.forward_var;
  }
  held_forward_m_ += u.forward_m;
  held_left_m_ += u.left_m;
  const bool gyro = gyroAlive(stamp);
  const double gyro_turn = gyro ? gyro_rate_ * u.dt_s : 0.0;
  const double wheel_turn = wheelsAlive(stamp) ? wheel_rate_ * u.dt_s : 0.0;
  held_gyro_turn_ += gyro_turn;
  held_wheel_turn_ += wheel_turn;
  u.turn_is_gyro = gyro && !standstill();
  if (!standstill()) u.turn_rad = gyro ? gyro_turn : wheel_turn;
  time_ = stamp;
  addNoise(u);
  return u;
}

Motion DeadReckoning::process(const WheelOdometry& wheels) {
  start(wheels.stamp);
  const double turn = wheels.T_previous_now.phi;
  // The chord of the arc, seen along the mean heading.
  const double c = std::cos(0.5 * turn);
  const double s = std::sin(0.5 * turn);
  const double forward = c * wheels.T_previous_now.x + s * wheels.T_previous_now.y;
  const double left = -s * wheels.T_previous_now.x + c * wheels.T_previous_now.y;

  Motion u;
  u.dt_s = toSeconds(wheels.stamp - time_);
  u.forward_m = forward - held_forward_m_;
  u.left_m = left - held_left_m_;
  held_forward_m_ = 0.0;
  held_left_m_ = 0.0;

  const double interval_s = wheels.dt_s > 0.0
                                ? wheels.dt_s
                                : (last_wheels_ ? toSeconds(wheels.stamp - *last_wheels_) : 0.0);
  const double old_speed = speed_forward_;
  speed_forward_ = interval_s > 0.0 ? forward / interval_s : 0.0;
  speed_left_ = interval_s > 0.0 ? left / interval_s : 0.0;
  wheel_rate_ = interval_s > 0.0 ? turn / interval_s : 0.0;
  if (last_wheels_) {
    u.forward_var = samplingVariance(squared(speed_forward_ - old_speed), interval_s);
  }
  wheel_period_s_ = interval_s;
  last_wheels_ = wheels.stamp;

  const bool moving = std::abs(speed_forward_) > params_.standstill_speed_mps ||
                      std::abs(speed_left_) > params_.standstill_speed_mps ||
                      std::abs(wheel_rate_) > params_.standstill_rate_radps;
  if (moving) {
    still_since_.reset();
  } else if (!still_since_) {
    still_since_ = wheels.stamp;
  }

  time_ = wheels.stamp;
  const bool gyro = gyroAlive(time_);
  const double gyro_turn = gyro ? gyro_rate_ * u.dt_s : 0.0;
  held_gyro_turn_ += gyro_turn;
  u.turn_is_gyro = gyro && !standstill();
  if (!standstill()) u.turn_rad = gyro ? gyro_turn : turn - held_wheel_turn_;
  held_wheel_turn_ = 0.0;
  addNoise(u);
  return u;
}

double DeadReckoning::verticalRate(const Imu& imu, double interval_s) {
  if (imu.accel_mps2.allFinite()) {
    ++up_samples_;
    const double share = std::max(1.0 / up_samples_, std::min(1.0, interval_s / kVerticalTime_s));
    up_imu_ += share * (imu.accel_mps2 - up_imu_);
  }
  const double force = up_imu_.norm();
  if (std::abs(force - kGravity) > kGravityTolerance) return imu.omega_radps.z();
  return imu.omega_radps.dot(up_imu_) / force;
}

Motion DeadReckoning::process(const Imu& imu, double gyro_bias_radps) {
  start(imu.stamp);
  const bool continuous = gyroAlive(imu.stamp);
  const double interval_s = last_imu_ ? toSeconds(imu.stamp - *last_imu_) : 0.0;
  const double rate = verticalRate(imu, interval_s);
  gyro_still_ = std::abs(rate - gyro_bias_radps) < params_.standstill_rate_radps;
  const double previous_rate = gyro_rate_;
  gyro_rate_ = rate;
  last_imu_ = imu.stamp;
  imu_period_s_ = interval_s;
  const double held = held_gyro_turn_;
  held_gyro_turn_ = 0.0;
  if (!continuous) return advance(imu.stamp);

  gyro_change_sq_ =
      kChangeMemory * gyro_change_sq_ + (1.0 - kChangeMemory) * squared(rate - previous_rate);
  Motion u = advance(imu.stamp);
  held_gyro_turn_ = 0.0;
  if (u.turn_is_gyro) {
    u.turn_rad = 0.5 * (previous_rate + rate) * interval_s - held;
    u.turn_var +=
        samplingVariance(std::max(gyro_change_sq_, squared(rate - previous_rate)), interval_s);
  }
  return u;
}

}  // namespace vestibule::ekf
