#include "dead_reckoning.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::ekf {
namespace {

/// A robot's speed and turn rate change within about this time [s]. Sampled more rarely, a rate
/// says little of what lay between its samples.
constexpr double kMotionTime_s = 0.2;
constexpr double kChangeMemory = 0.8;
/// Slower turns may be noise of the gyro.
constexpr double kStraight_radps = 0.05;
/// Turn of a robot whose wheels stand and whose gyro is quiet [rad/sqrt(s)].
constexpr double kStandingTurn = 1e-4;
/// A robot whose wheels are silent keeps its speed for about so long [s] ...
constexpr double kHeldSpeed_s = 5.0;
/// ... and moves sideways by this share of the variance, as far as its heading is known.
constexpr double kSideways = 0.1;
/// Unseen turns of a robot without gyro and wheels' yaw rate [rad/sqrt(s)].
constexpr double kBlindTurn = 0.5;
/// Unseen change of roll and pitch without a gyro [rad/sqrt(s)].
constexpr double kBlindTilt = 0.05;
/// Wheels leave the ground plane of the robot by so much [m/sqrt(m)].
constexpr double kUpSigma_sqrt_m = 0.01;
/// Of the speed by the wheels: constant [m/s] and share.
constexpr double kSpeedSigma_mps = 0.03;
constexpr double kSpeedSigma = 0.02;
/// Wheel messages nearer to each other tell no speed [s].
constexpr double kLeastInterval_s = 1e-3;
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

/// Of the wheels' variances while they slip.
constexpr double kSlipInflation = 100.0;

}  // namespace

Eigen::Vector3d DeadReckoning::rate() const {
  return rateIsGyro() ? gyro_rate_ : Eigen::Vector3d(0.0, 0.0, wheel_rate_);
}

Eigen::Vector3d DeadReckoning::ownAcceleration(const Eigen::Vector3d& gyro_bias_radps) const {
  Eigen::Vector3d omega = rate();
  if (rateIsGyro()) omega -= gyro_bias_radps;
  return Eigen::Vector3d(wheel_acceleration_mps2_, 0.0, 0.0) +
         omega.cross(Eigen::Vector3d(speed_forward_, speed_left_, 0.0));
}

bool DeadReckoning::wheelsAlive(Timestamp stamp) const {
  return last_wheels_ && toSeconds(stamp - *last_wheels_) <=
                             std::max(params_->wheels.max_gap_s, 2.5 * wheel_period_s_);
}

bool DeadReckoning::gyroAlive(Timestamp stamp) const {
  return last_imu_ &&
         toSeconds(stamp - *last_imu_) <= std::max(params_->gyro.max_gap_s, 2.5 * imu_period_s_);
}

bool DeadReckoning::standstill() const {
  return still_since_ && toSeconds(time_ - *still_since_) >= params_->standstill_s &&
         wheelsAlive(time_) && (gyro_still_ || !gyroAlive(time_));
}

void DeadReckoning::start(Timestamp stamp) {
  if (started_) return;
  started_ = true;
  time_ = stamp;
}

void DeadReckoning::addNoise(Motion& u) const {
  const WheelParams& wheels = params_->wheels;
  const double path_m = u.rolling ? std::sqrt(squared(u.forward_m) + squared(u.left_m)) : 0.0;
  const double doubt = slips_until_ && time_ < *slips_until_ ? kSlipInflation : 1.0;
  u.forward_var += doubt * squared(wheels.distance_sigma_sqrt_m) * path_m;
  const double turned_rad = std::max(0.0, std::abs(u.turn_rad.z()) - kStraight_radps * u.dt_s);
  u.left_var += doubt * (squared(wheels.lateral_sigma_sqrt_m) * path_m +
                         squared(wheels.turn_lateral_sigma_m_sqrt_rad) * std::abs(u.turn_rad.z()));
  if (u.turn_is_gyro) {
    const double noise_var = squared(params_->gyro.noise_rad_sqrt_s) * u.dt_s;
    // Right for a turn of a quarter, in however many steps it is taken.
    u.turn_var += noise_var + squared(params_->gyro.scale_sigma) * 0.5 * kPi * turned_rad;
    u.tilt_var = noise_var;
  } else if (standstill()) {
    u.turn_var += squared(kStandingTurn) * u.dt_s;
    u.tilt_var = squared(kStandingTurn) * u.dt_s;
  } else if (!params_->use.wheelYawRate() || !wheelsAlive(time_)) {
    u.turn_var += squared(kBlindTurn) * u.dt_s;
    u.tilt_var = squared(kBlindTilt) * u.dt_s;
  } else {
    u.turn_var += squared(wheels.yaw_sigma_per_rad) * std::abs(u.turn_rad.z()) +
                  squared(wheels.yaw_sigma_sqrt_m) * path_m;
    u.tilt_var = squared(kBlindTilt) * u.dt_s;
  }
  if (u.rolling) {
    u.up_var = squared(kUpSigma_sqrt_m) * path_m;
    u.speed_mps = wheelsAlive(time_) ? speed_forward_ : 0.0;
    u.left_mps = wheelsAlive(time_) ? speed_left_ : 0.0;
    u.speed_var = !wheelsAlive(time_) ? squared(wheels.dropout_speed_sigma_mps)
                  : standstill()      ? squared(params_->standstill_speed_mps)
                                      : squared(kSpeedSigma_mps + kSpeedSigma * u.speed_mps);
  } else {
    u.speed_var = squared(params_->accel.noise_mps2_sqrt_hz) * u.dt_s;
  }
  u.gyro_bias_var = squared(params_->gyro.bias_walk_radps_sqrt_s) * u.dt_s;
  u.accel_bias_var = squared(params_->accel.bias_walk_mps2_sqrt_s) * u.dt_s;
  u.wheel_scale_var = squared(wheels.scale_walk_sqrt_m) * path_m;
  const HeadingParams& heading = params_->heading;
  u.heading_offset_var = squared(heading.offset_walk_rad_sqrt_s) * u.dt_s +
                         squared(heading.turn_offset_rad_sqrt_rad) * turned_rad;
  u.disturbance_decay = std::exp(-u.dt_s / params_->heading.disturbance_time_s);
  u.disturbance_var =
      squared(params_->heading.disturbance_sigma_rad) * (1.0 - squared(u.disturbance_decay));
}

Motion DeadReckoning::advance(Timestamp stamp) {
  start(stamp);
  Motion u;
  u.dt_s = toSeconds(stamp - time_);
  const bool gyro = gyroAlive(stamp);
  if (wheelsAlive(stamp)) {
    u.forward_m = speed_forward_ * u.dt_s;
    u.left_m = speed_left_ * u.dt_s;
  } else if (last_wheels_ && !params_->plane && gyro && has_force_) {
    u.rolling = false;
    u.force_mps2 = force_mps2_;
  } else {
    // Whatever speed it has, it keeps for a while: the way grows with time, not with its root.
    const double silent_s =
        last_wheels_ ? std::min(toSeconds(time_ - *last_wheels_), kHeldSpeed_s) : 0.0;
    u.forward_var = squared(params_->wheels.dropout_speed_sigma_mps) * u.dt_s *
                    (2.0 * silent_s + std::min(u.dt_s, kHeldSpeed_s));
    u.left_var = (gyro ? kSideways : 1.0) * u.forward_var;
  }
  held_forward_m_ += u.forward_m;
  held_left_m_ += u.left_m;
  const Eigen::Vector3d gyro_turn =
      gyro ? Eigen::Vector3d(gyro_rate_ * u.dt_s) : Eigen::Vector3d::Zero();
  const double wheel_turn = wheelsAlive(stamp) ? wheel_rate_ * u.dt_s : 0.0;
  held_gyro_turn_ += gyro_turn;
  held_wheel_turn_ += wheel_turn;
  turn(u, gyro, gyro_turn, wheel_turn);
  time_ = stamp;
  addNoise(u);
  return u;
}

void DeadReckoning::turn(
    Motion& u, bool gyro, const Eigen::Vector3d& gyro_turn_rad, double wheel_turn_rad) {
  u.turn_is_gyro = gyro && !standstill();
  if (u.turn_is_gyro) {
    u.turn_rad = gyro_turn_rad;
  } else if (!standstill() && params_->use.wheelYawRate()) {
    u.turn_rad.z() = wheel_turn_rad;
  }
  gyro_turn_since_wheels_ += gyro_turn_rad.z();
  gyro_since_wheels_ = gyro_since_wheels_ && gyro;
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
  // Over no time at all nothing can be said of the speed.
  const bool timed = interval_s > kLeastInterval_s;
  speed_forward_ = timed ? forward / interval_s : 0.0;
  speed_left_ = timed ? left / interval_s : 0.0;
  wheel_rate_ = timed ? turn / interval_s : 0.0;
  if (last_wheels_) {
    u.forward_var = samplingVariance(squared(speed_forward_ - old_speed), interval_s);
  }
  wheel_acceleration_mps2_ =
      last_wheels_ && timed ? (speed_forward_ - old_speed) / interval_s : 0.0;
  wheel_period_s_ = interval_s;
  last_wheels_ = wheels.stamp;

  const bool moving = std::abs(speed_forward_) > params_->standstill_speed_mps ||
                      std::abs(speed_left_) > params_->standstill_speed_mps ||
                      std::abs(wheel_rate_) > params_->standstill_rate_radps;
  if (moving) {
    still_since_.reset();
  } else if (!still_since_) {
    still_since_ = wheels.stamp;
  }

  time_ = wheels.stamp;
  const bool gyro = gyroAlive(time_);
  const Eigen::Vector3d gyro_turn =
      gyro ? Eigen::Vector3d(gyro_rate_ * u.dt_s) : Eigen::Vector3d::Zero();
  held_gyro_turn_ += gyro_turn;
  this->turn(u, gyro, gyro_turn, turn - held_wheel_turn_);
  held_wheel_turn_ = 0.0;
  wheel_turn_.reset();
  if (gyro_since_wheels_ && timed) {
    wheel_turn_ = WheelTurn{turn, gyro_turn_since_wheels_, forward, interval_s};
  }
  gyro_turn_since_wheels_ = 0.0;
  gyro_since_wheels_ = gyro;
  addNoise(u);
  return u;
}

Eigen::Vector3d DeadReckoning::rateOf(const Imu& imu, double interval_s) {
  if (!params_->plane) return imu.omega_radps;
  if (imu.accel_mps2.allFinite()) {
    ++up_samples_;
    const double share = std::max(1.0 / up_samples_, std::min(1.0, interval_s / kVerticalTime_s));
    up_imu_ += share * (imu.accel_mps2 - up_imu_);
  }
  const double force = up_imu_.norm();
  const bool level = !(std::abs(force - kGravity) > kGravityTolerance);
  return {0.0, 0.0, level ? imu.omega_radps.dot(up_imu_) / force : imu.omega_radps.z()};
}

Eigen::Vector3d DeadReckoning::forceAtBase(const Imu& imu, double interval_s) const {
  const auto& at = params_->accel.position_m;
  const Eigen::Vector3d lever(at[0], at[1], at[2]);
  const Eigen::Vector3d& omega = imu.omega_radps;
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();  // acceleration
  if (interval_s > kLeastInterval_s) angular = (omega - raw_rate_) / interval_s;
  return imu.accel_mps2 - omega.cross(omega.cross(lever)) - angular.cross(lever);
}

Motion DeadReckoning::process(const Imu& imu, const Eigen::Vector3d& gyro_bias_radps) {
  start(imu.stamp);
  const bool continuous = gyroAlive(imu.stamp);
  const double interval_s = last_imu_ ? toSeconds(imu.stamp - *last_imu_) : 0.0;
  const Eigen::Vector3d rate = rateOf(imu, interval_s);
  gyro_still_ = (rate - gyro_bias_radps).norm() < params_->standstill_rate_radps;
  has_force_ = params_->use.imuAcceleration() && imu.accel_mps2.allFinite() &&
               std::abs(imu.accel_mps2.norm() - kGravity) < 0.5 * kGravity;
  if (has_force_) force_mps2_ = forceAtBase(imu, continuous ? interval_s : 0.0);
  raw_rate_ = imu.omega_radps;
  if (!params_->use.imuYawRate()) return advance(imu.stamp);
  const Eigen::Vector3d previous_rate = gyro_rate_;
  gyro_rate_ = rate;
  last_imu_ = imu.stamp;
  imu_period_s_ = interval_s;
  const Eigen::Vector3d held = held_gyro_turn_;
  held_gyro_turn_.setZero();
  if (!continuous) return advance(imu.stamp);

  const double change_sq = squared(rate.z() - previous_rate.z());
  gyro_change_sq_ = kChangeMemory * gyro_change_sq_ + (1.0 - kChangeMemory) * change_sq;
  Motion u = advance(imu.stamp);
  held_gyro_turn_.setZero();
  // The mean of both samples over the interval, less what was already taken.
  const Eigen::Vector3d measured = 0.5 * (previous_rate + rate) * interval_s - held;
  gyro_turn_since_wheels_ += measured.z() - rate.z() * u.dt_s;
  if (u.turn_is_gyro) {
    u.turn_rad = measured;
    u.turn_var += samplingVariance(std::max(gyro_change_sq_, change_sq), interval_s);
  }
  return u;
}

}  // namespace vestibule::ekf
