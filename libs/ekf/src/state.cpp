#include "vestibule/ekf/state.hpp"

#include <algorithm>
#include <cmath>

#include "half_turn.hpp"
#include "vestibule/core/angles.hpp"

namespace vestibule::ekf {
namespace {

/// Exp(turn) q. A level attitude that is turned about the vertical is what the plane consists of:
/// the same numbers without the products by zero.
Eigen::Quaterniond turned(const Eigen::Quaterniond& q, const Eigen::Vector3d& turn_rad) {
  if (q.x() != 0.0 || q.y() != 0.0 || turn_rad.x() != 0.0 || turn_rad.y() != 0.0) {
    return (rotationExp(turn_rad) * q).normalized();
  }
  const LevelTurn sum = normalized(levelTurn(turn_rad.z()) * LevelTurn{q.w(), q.z()});
  return {sum.w, 0.0, 0.0, sum.z};
}

}  // namespace

double State::yaw() const {
  return std::atan2(
      2.0 * (q.w() * q.z() + q.x() * q.y()), 1.0 - 2.0 * (q.y() * q.y() + q.z() * q.z()));
}

Pose3 State::pose3() const {
  const Eigen::Matrix3d R = q.toRotationMatrix();
  Pose3 T;
  T.x = p.x();
  T.y = p.y();
  T.z = p.z();
  T.yaw = yaw();
  T.pitch = std::asin(std::min(1.0, std::max(-1.0, -R(2, 0))));
  T.roll = std::atan2(R(2, 1), R(2, 2));
  return T;
}

bool State::allFinite() const {
  return p.allFinite() && v.allFinite() && q.coeffs().allFinite() && gyro_bias.allFinite() &&
         accel_bias.allFinite() && gnss_bias.allFinite() && std::isfinite(wheel_scale) &&
         std::isfinite(wheel_skew) && std::isfinite(track) && std::isfinite(icr_x) &&
         std::isfinite(heading_offset) && std::isfinite(disturbance);
}

State plus(const State& x, const Error& error) {
  State y = x;
  y.p += error.segment<3>(kPos);
  y.v += error.segment<3>(kVel);
  y.q = turned(x.q, error.segment<3>(kAtt));
  y.gyro_bias += error.segment<3>(kGyroBias);
  y.accel_bias += error.segment<3>(kAccelBias);
  y.wheel_scale += error[kWheelScale];
  y.wheel_skew += error[kWheelSkew];
  y.track += error[kTrack];
  y.icr_x += error[kIcrX];
  y.gnss_bias += error.segment<3>(kGnssBias);
  y.heading_offset = wrapToPi(x.heading_offset + error[kHeadingOffset]);
  y.disturbance += error[kDisturbance];
  return y;
}

Error minus(const State& to, const State& from) {
  Error e;
  e.segment<3>(kPos) = to.p - from.p;
  e.segment<3>(kVel) = to.v - from.v;
  Eigen::Quaterniond turn = to.q * from.q.conjugate();
  if (turn.w() < 0.0) turn.coeffs() *= -1.0;
  const double s = turn.vec().norm();
  const double angle = 2.0 * std::atan2(s, turn.w());
  e.segment<3>(kAtt) = s > 1e-12 ? Eigen::Vector3d(turn.vec() * (angle / s)) : 2.0 * turn.vec();
  e.segment<3>(kGyroBias) = to.gyro_bias - from.gyro_bias;
  e.segment<3>(kAccelBias) = to.accel_bias - from.accel_bias;
  e[kWheelScale] = to.wheel_scale - from.wheel_scale;
  e[kWheelSkew] = to.wheel_skew - from.wheel_skew;
  e[kTrack] = to.track - from.track;
  e[kIcrX] = to.icr_x - from.icr_x;
  e.segment<3>(kGnssBias) = to.gnss_bias - from.gnss_bias;
  e[kHeadingOffset] = angleDiff(to.heading_offset, from.heading_offset);
  e[kDisturbance] = to.disturbance - from.disturbance;
  return e;
}

Eigen::Quaterniond rotationExp(const Eigen::Vector3d& turn_rad) {
  const HalfTurn half = halfTurn(turn_rad.squaredNorm());
  const Eigen::Vector3d vec = half.share * turn_rad;
  return {half.cosine, vec.x(), vec.y(), vec.z()};
}

Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d S;
  S << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return S;
}

Eigen::Quaterniond attitudeOf(double yaw_rad, double pitch_rad, double roll_rad) {
  return Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitX());
}

}  // namespace vestibule::ekf
