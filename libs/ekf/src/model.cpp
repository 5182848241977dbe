#include "vestibule/ekf/model.hpp"

#include <array>
#include <cmath>

#include "half_turn.hpp"
#include "vestibule/core/angles.hpp"

namespace vestibule::ekf {
namespace {

constexpr double kGravity_mps2 = 9.81;

// What a step takes from: attitude and the wheels' faults while they carry the robot, velocity and
// the accelerometer's faults while it coasts; and what may be wrong with the turn.
constexpr std::uint32_t kRolling = bits(kAtt, 3) | bits(kWheelScale, 1) | bits(kIcrX, 1);
constexpr std::uint32_t kCoasting = bits(kVel, 3) | bits(kAtt, 3) | bits(kAccelBias, 3);
constexpr std::uint32_t kTurnByGyro = bits(kGyroBias, 3);
constexpr std::uint32_t kTurnByWheels = bits(kWheelSkew, 1) | bits(kTrack, 1);
/// The step in map axes and what its parts are made of.
struct Course {
  Eigen::Vector3d turn;   ///< base axes, faults removed
  Eigen::Matrix3d R_mid;  ///< attitude halfway
  Eigen::Quaterniond q_end;
  Eigen::Vector3d by_wheels;  ///< rolling: displacement by the wheels, map axes
  Eigen::Vector3d d;          ///< displacement, map axes
  Eigen::Vector3d v_end;
  Eigen::Vector3d push;  ///< coasting: specific force in map axes, bias removed
};

Course courseOf(const State& x, const Motion& u, bool planar) {
  Course c;
  c.turn = planar ? Eigen::Vector3d(0.0, 0.0, u.turn_rad.z()) : u.turn_rad;
  if (u.turn_is_gyro) {
    c.turn.z() -= x.gyro_bias.z() * u.dt_s;
    if (!planar) c.turn.head<2>() -= x.gyro_bias.head<2>() * u.dt_s;
  } else {
    c.turn.z() = std::exp(-x.track) * c.turn.z() + x.wheel_skew * u.forward_m;
  }
  const Eigen::Quaterniond half = rotationExp(0.5 * c.turn);
  const Eigen::Quaterniond q_mid = x.q * half;
  c.q_end = (q_mid * half).normalized();
  c.R_mid = q_mid.toRotationMatrix();
  c.push.setZero();
  if (u.rolling) {
    const double scale = std::exp(x.wheel_scale);
    c.by_wheels = c.R_mid * Eigen::Vector3d(scale * u.forward_m, scale * u.left_m, 0.0);
    c.d = c.by_wheels - c.R_mid.col(1) * (x.icr_x * c.turn.z());
    c.v_end = c.q_end * Eigen::Vector3d(scale * u.speed_mps, scale * u.left_mps, 0.0);
  } else {
    c.by_wheels.setZero();
    c.push = c.R_mid * (u.force_mps2 - x.accel_bias);
    const Eigen::Vector3d a = c.push - Eigen::Vector3d(0.0, 0.0, kGravity_mps2);
    c.d = u.dt_s * x.v + (0.5 * u.dt_s * u.dt_s) * a;
    c.v_end = x.v + u.dt_s * a;
  }
  return c;
}

State arrived(const State& x, const Motion& u, const Course& c) {
  State next = x;
  next.p += c.d;
  next.v = c.v_end;
  next.q = c.q_end;
  next.gnss_bias *= u.gnss_bias_decay;
  next.heading_offset *= u.heading_offset_decay;
  next.disturbance *= u.disturbance_decay;
  return next;
}

/// Of the states that depend on themselves alone.
void lineariseRest(const Motion& u, bool planar, Transition& t) {
  t.keep.segment<3>(kVel).setZero();
  t.keep.segment<3>(kGnssBias).setConstant(u.gnss_bias_decay);
  t.keep[kHeadingOffset] = u.heading_offset_decay;
  t.keep[kDisturbance] = u.disturbance_decay;
  const auto noise = [&t](int index) -> double& { return t.rest_noise[index - Transition::kTop]; };
  for (int i = planar ? 2 : 0; i < 3; ++i) noise(kGyroBias + i) = u.gyro_bias_var;
  for (int i = 0; i < (planar ? 2 : 3); ++i) noise(kGnssBias + i) = u.gnss_bias_var;
  if (!planar) {
    for (int i = 0; i < 3; ++i) noise(kAccelBias + i) = u.accel_bias_var;
  }
  noise(kWheelScale) = u.wheel_scale_var;
  noise(kWheelSkew) = u.wheel_skew_var;
  noise(kTrack) = u.track_var;
  noise(kIcrX) = u.icr_var;
  noise(kHeadingOffset) = u.heading_offset_var;
  noise(kDisturbance) = u.disturbance_var;
}

/// Fills in `t`, which is all zero but for `keep`.
void linearise(const State& x, const Motion& u, const Course& c, bool planar, Transition& t) {
  auto& A = t.coupling;
  lineariseRest(u, planar, t);

  // What a turn error about each base axis does to position, velocity and attitude.
  Eigen::Matrix<double, 9, 3> by_turn = Eigen::Matrix<double, 9, 3>::Zero();
  const int first_axis = planar ? 2 : 0;
  for (int i = first_axis; i < 3; ++i) {
    const Eigen::Vector3d axis = c.R_mid.col(i);
    auto column = by_turn.col(i);
    column.segment<3>(kAtt) = axis;
    if (u.rolling) {
      column.segment<3>(kPos) = -0.5 * c.d.cross(axis);
      column.segment<3>(kVel) = -c.v_end.cross(axis);
    } else {
      column.segment<3>(kVel) = (-0.5 * u.dt_s) * c.push.cross(axis);
      column.segment<3>(kPos) = 0.5 * u.dt_s * column.segment<3>(kVel);
    }
  }
  if (u.rolling) by_turn.col(2).segment<3>(kPos) -= x.icr_x * c.R_mid.col(1);

  if (u.rolling) {
    A.block<3, 3>(kPos, kAtt) = -skew(c.d);
    A.block<3, 3>(kVel, kAtt) = -skew(c.v_end);
    A.col(kWheelScale).segment<3>(kPos) = c.by_wheels;
    A.col(kWheelScale).segment<3>(kVel) = c.v_end;
    A.col(kIcrX).segment<3>(kPos) = -c.turn.z() * c.R_mid.col(1);
    t.columns = kRolling;
  } else {
    const Eigen::Matrix3d skew_push = skew(c.push);
    A.block<3, 3>(kVel, kVel).setIdentity();
    A.block<3, 3>(kPos, kVel) = u.dt_s * Eigen::Matrix3d::Identity();
    A.block<3, 3>(kVel, kAtt) = -u.dt_s * skew_push;
    A.block<3, 3>(kPos, kAtt) = (-0.5 * u.dt_s * u.dt_s) * skew_push;
    A.block<3, 3>(kVel, kAccelBias) = -u.dt_s * c.R_mid;
    A.block<3, 3>(kPos, kAccelBias) = (-0.5 * u.dt_s * u.dt_s) * c.R_mid;
    t.columns = kCoasting;
  }
  if (u.turn_is_gyro) {
    for (int i = first_axis; i < 3; ++i) A.col(kGyroBias + i) = -u.dt_s * by_turn.col(i);
    t.columns |= kTurnByGyro;
  } else {
    A.col(kTrack) = -std::exp(-x.track) * u.turn_rad.z() * by_turn.col(2);
    A.col(kWheelSkew) = u.forward_m * by_turn.col(2);
    t.columns |= kTurnByWheels;
  }
  if (planar) t.columns &= ~kSpatial;

  auto& Q = t.top_noise;
  const Eigen::Matrix<double, 9, 1> turn_noise = u.turn_var * by_turn.col(2);
  if (planar) {
    for (const int j : {+kPos, kPos + 1, +kVel, kVel + 1, kAtt + 2}) {
      Q.col(j) = turn_noise * by_turn(j, 2);
    }
  } else {
    const Eigen::Matrix<double, 9, 2> tilt_noise = u.tilt_var * by_turn.leftCols<2>();
    for (int j = 0; j < Transition::kTop; ++j) {
      Q.col(j) = turn_noise * by_turn(j, 2) + tilt_noise.col(0) * by_turn(j, 0) +
                 tilt_noise.col(1) * by_turn(j, 1);
    }
  }
  const Eigen::Matrix3d& R = c.R_mid;
  auto Q_p = Q.block<3, 3>(kPos, kPos);
  Q_p += u.forward_var * R.col(0) * R.col(0).transpose() +
         u.left_var * R.col(1) * R.col(1).transpose();
  if (!planar) Q_p += u.up_var * R.col(2) * R.col(2).transpose();
  const int axes = planar ? 2 : 3;
  for (int i = 0; i < axes; ++i) {
    Q(kVel + i, kVel + i) += u.speed_var;
    if (u.rolling) continue;
    // An impulse halfway.
    Q(kPos + i, kPos + i) += 0.25 * u.dt_s * u.dt_s * u.speed_var;
    Q(kPos + i, kVel + i) += 0.5 * u.dt_s * u.speed_var;
    Q(kVel + i, kPos + i) += 0.5 * u.dt_s * u.speed_var;
  }
}

/// Nearly every step: a level robot rolls in the plane. The same numbers as by the functions above,
/// without the products by zero.
struct LevelCourse {
  double turn_rad;  ///< faults removed
  double cosine;    ///< of the heading halfway
  double sine;
  LevelTurn q_end;
  Eigen::Vector2d by_wheels;
  Eigen::Vector2d d;
  Eigen::Vector2d v_end;
};

bool rollsLevel(const State& x, const Motion& u, bool planar) {
  return planar && u.rolling && x.q.x() == 0.0 && x.q.y() == 0.0;
}

LevelCourse levelCourseOf(const State& x, const Motion& u) {
  LevelCourse c;
  c.turn_rad = u.turn_is_gyro ? u.turn_rad.z() - x.gyro_bias.z() * u.dt_s
                              : std::exp(-x.track) * u.turn_rad.z() + x.wheel_skew * u.forward_m;
  const LevelTurn half = levelTurn(0.5 * c.turn_rad);
  const LevelTurn mid = LevelTurn{x.q.w(), x.q.z()} * half;
  c.q_end = normalized(mid * half);
  c.sine = 2.0 * mid.z * mid.w;
  c.cosine = 1.0 - 2.0 * mid.z * mid.z;
  const double scale = std::exp(x.wheel_scale);
  const double forward_m = scale * u.forward_m;
  const double left_m = scale * u.left_m;
  c.by_wheels << c.cosine * forward_m - c.sine * left_m, c.sine * forward_m + c.cosine * left_m;
  const double swing_m = x.icr_x * c.turn_rad;
  c.d << c.by_wheels.x() + c.sine * swing_m, c.by_wheels.y() - c.cosine * swing_m;
  const Eigen::Vector2d v(scale * u.speed_mps, scale * u.left_mps);
  const Eigen::Vector2d twice(-2.0 * (c.q_end.z * v.y()), 2.0 * (c.q_end.z * v.x()));
  c.v_end << v.x() + c.q_end.w * twice.x() - c.q_end.z * twice.y(),
      v.y() + c.q_end.w * twice.y() + c.q_end.z * twice.x();
  return c;
}

State arrived(const State& x, const Motion& u, const LevelCourse& c) {
  State next = x;
  next.p.head<2>() += c.d;
  next.v << c.v_end, 0.0;
  next.q = Eigen::Quaterniond(c.q_end.w, 0.0, 0.0, c.q_end.z);
  next.gnss_bias *= u.gnss_bias_decay;
  next.heading_offset *= u.heading_offset_decay;
  next.disturbance *= u.disturbance_decay;
  return next;
}

void linearise(const State& x, const Motion& u, const LevelCourse& c, Transition& t) {
  constexpr std::array<int, 5> kTop = {kPos, kPos + 1, kVel, kVel + 1, kAtt + 2};
  lineariseRest(u, true, t);
  auto& A = t.coupling;
  A(kPos, kAtt + 2) = -c.d.y();
  A(kPos + 1, kAtt + 2) = c.d.x();
  A(kVel, kAtt + 2) = -c.v_end.y();
  A(kVel + 1, kAtt + 2) = c.v_end.x();
  A(kPos, kWheelScale) = c.by_wheels.x();
  A(kPos + 1, kWheelScale) = c.by_wheels.y();
  A(kVel, kWheelScale) = c.v_end.x();
  A(kVel + 1, kWheelScale) = c.v_end.y();
  A(kPos, kIcrX) = c.turn_rad * c.sine;
  A(kPos + 1, kIcrX) = -c.turn_rad * c.cosine;
  t.columns = kRolling;
  // What an error of the turn does.
  const std::array<double, 5> by_turn = {
      -0.5 * c.d.y() + x.icr_x * c.sine,
      0.5 * c.d.x() - x.icr_x * c.cosine,
      -c.v_end.y(),
      c.v_end.x(),
      1.0};
  const double by_track = -std::exp(-x.track) * u.turn_rad.z();
  for (std::size_t a = 0; a < kTop.size(); ++a) {
    if (u.turn_is_gyro) {
      A(kTop[a], kGyroBias + 2) = -u.dt_s * by_turn[a];
    } else {
      A(kTop[a], kTrack) = by_track * by_turn[a];
      A(kTop[a], kWheelSkew) = u.forward_m * by_turn[a];
    }
    for (std::size_t b = 0; b < kTop.size(); ++b) {
      t.top_noise(kTop[a], kTop[b]) = u.turn_var * by_turn[a] * by_turn[b];
    }
  }
  t.columns |= u.turn_is_gyro ? kTurnByGyro : kTurnByWheels;
  t.columns &= ~kSpatial;
  auto Q_p = t.top_noise.topLeftCorner<2, 2>();
  const Eigen::Vector2d ahead(c.cosine, c.sine);
  const Eigen::Vector2d left(-c.sine, c.cosine);
  Q_p += u.forward_var * ahead * ahead.transpose() + u.left_var * left * left.transpose();
  t.top_noise(kVel, kVel) += u.speed_var;
  t.top_noise(kVel + 1, kVel + 1) += u.speed_var;
}

}  // namespace

void Motion::append(const Motion& next) {
  dt_s += next.dt_s;
  forward_m += next.forward_m;
  left_m += next.left_m;
  turn_rad += next.turn_rad;
  speed_mps = next.speed_mps;
  left_mps = next.left_mps;
  speed_var = next.speed_var;

  forward_var += next.forward_var;
  left_var += next.left_var;
  up_var += next.up_var;
  turn_var += next.turn_var;
  tilt_var += next.tilt_var;
  gyro_bias_var += next.gyro_bias_var;
  accel_bias_var += next.accel_bias_var;
  wheel_scale_var += next.wheel_scale_var;
  wheel_skew_var += next.wheel_skew_var;
  track_var += next.track_var;
  icr_var += next.icr_var;

  const auto decayed = [](double var, double decay) { return decay * decay * var; };
  gnss_bias_var = decayed(gnss_bias_var, next.gnss_bias_decay) + next.gnss_bias_var;
  gnss_bias_decay *= next.gnss_bias_decay;
  heading_offset_var =
      decayed(heading_offset_var, next.heading_offset_decay) + next.heading_offset_var;
  heading_offset_decay *= next.heading_offset_decay;
  disturbance_var = decayed(disturbance_var, next.disturbance_decay) + next.disturbance_var;
  disturbance_decay *= next.disturbance_decay;
}

StateMatrix Transition::F() const {
  StateMatrix F = keep.asDiagonal();
  F.topRows<kTop>() += coupling;
  return F;
}

StateMatrix Transition::Q() const {
  StateMatrix Q = StateMatrix::Zero();
  Q.topLeftCorner<kTop, kTop>() = top_noise;
  Q.diagonal().tail<kRest>() = rest_noise;
  return Q;
}

bool Observation::finite() const {
  // Zero times anything that is not finite is not a number.
  double sum = 0.0;
  for (int i = 0; i < rows; ++i) {
    sum += 0.0 * residual[i];
    for (int j = 0; j < rows; ++j) sum += 0.0 * R(i, j);
  }
  for (std::uint32_t left = columns; left != 0U; left &= left - 1U) {
    for (int i = 0; i < rows; ++i) sum += 0.0 * H(i, __builtin_ctz(left));
  }
  return rows >= 1 && sum == 0.0;
}

State Model::transition(const State& x, const Motion& u) const {
  if (rollsLevel(x, u, planar_)) return arrived(x, u, levelCourseOf(x, u));
  return arrived(x, u, courseOf(x, u, planar_));
}

Model::Predicted Model::predict(const State& x, const Motion& u) const {
  return {transition(x, u), linearised(x, u)};
}

Transition Model::linearised(const State& x, const Motion& u) const {
  Transition t;
  if (rollsLevel(x, u, planar_)) {
    linearise(x, u, levelCourseOf(x, u), t);
  } else {
    linearise(x, u, courseOf(x, u, planar_), planar_, t);
  }
  return t;
}

void Model::constrain(StateMatrix& P) const {
  if (!planar_) return;
  for (int i = 0; i < kStateSize; ++i) {
    if ((kSpatial >> static_cast<unsigned>(i) & 1U) == 0U) continue;
    P.row(i).setZero();
    P.col(i).setZero();
  }
}

Observation Model::gnssPosition(
    const State& x,
    const Eigen::Vector3d& p_map_antenna,
    const Eigen::Vector3d& p_base_antenna,
    const Eigen::Matrix3d& R) const {
  const Eigen::Vector3d lever = x.q * p_base_antenna;
  const Eigen::Matrix3d by_attitude = -skew(lever);
  Observation z;
  z.rows = planar_ ? 2 : 3;
  z.residual = p_map_antenna - x.p - lever - x.gnss_bias;
  z.R = R;
  for (int i = 0; i < z.rows; ++i) {
    z.set(i, kPos + i, 1.0);
    z.set(i, kGnssBias + i, 1.0);
    z.set(i, kAtt + 2, by_attitude(i, 2));
    if (planar_) continue;
    z.set(i, kAtt, by_attitude(i, 0));
    z.set(i, kAtt + 1, by_attitude(i, 1));
  }
  return z;
}

Observation Model::gnssVelocity(
    const State& x,
    const Eigen::Vector3d& v_map_antenna,
    const Eigen::Vector3d& p_base_antenna,
    const Eigen::Vector3d& omega_radps,
    bool omega_is_gyro,
    double sigma_mps) const {
  const Eigen::Matrix3d R = x.q.toRotationMatrix();
  Eigen::Vector3d omega = omega_radps;
  if (omega_is_gyro) omega -= x.gyro_bias;
  const Eigen::Vector3d swing = R * omega.cross(p_base_antenna);
  const Eigen::Matrix3d by_attitude = -skew(swing);
  const Eigen::Matrix3d by_bias = R * skew(p_base_antenna);
  Observation z;
  z.rows = planar_ || std::isnan(v_map_antenna.z()) ? 2 : 3;
  z.residual.head(z.rows) = (v_map_antenna - x.v - swing).head(z.rows);
  z.R *= sigma_mps * sigma_mps;
  for (int i = 0; i < z.rows; ++i) {
    z.set(i, kVel + i, 1.0);
    for (int j = planar_ ? 2 : 0; j < 3; ++j) {
      z.set(i, kAtt + j, by_attitude(i, j));
      if (omega_is_gyro) z.set(i, kGyroBias + j, by_bias(i, j));
    }
  }
  return z;
}

Observation Model::heading(const State& x, double yaw_rad, double sigma_rad) const {
  Observation z;
  z.rows = 1;
  z.residual[0] = angleDiff(yaw_rad, x.yaw() + x.heading_offset + x.disturbance);
  z.R(0, 0) = sigma_rad * sigma_rad;
  z.set(0, kAtt + 2, 1.0);
  z.set(0, kHeadingOffset, 1.0);
  z.set(0, kDisturbance, 1.0);
  if (!planar_) {
    const Eigen::Vector3d nose = x.q * Eigen::Vector3d::UnitX();
    const double level_sq = nose.head<2>().squaredNorm();
    if (level_sq > 1e-6) {
      z.set(0, kAtt, -nose.z() * nose.x() / level_sq);
      z.set(0, kAtt + 1, -nose.z() * nose.y() / level_sq);
    }
  }
  return z;
}

Observation Model::tilt(const State& x, double roll_rad, double pitch_rad, double sigma_rad) const {
  const Eigen::Vector3d up =
      attitudeOf(0.0, pitch_rad, roll_rad).conjugate() * Eigen::Vector3d::UnitZ();
  const Eigen::Matrix3d R_base_map = x.q.conjugate().toRotationMatrix();
  const Eigen::Matrix3d by_attitude = R_base_map * skew(Eigen::Vector3d::UnitZ());
  Observation z;
  z.rows = 3;
  z.residual = up - R_base_map.col(2);
  z.R = sigma_rad * sigma_rad * Eigen::Matrix3d::Identity();
  for (int i = 0; i < 3; ++i) {
    z.set(i, kAtt, by_attitude(i, 0));
    z.set(i, kAtt + 1, by_attitude(i, 1));
  }
  return z;
}

Observation Model::gravity(
    const State& x,
    const Eigen::Vector3d& force_mps2,
    const Eigen::Vector3d& accel_base_mps2,
    double sigma_mps2) const {
  const Eigen::Matrix3d R_base_map = x.q.conjugate().toRotationMatrix();
  const Eigen::Matrix3d by_attitude = kGravity_mps2 * R_base_map * skew(Eigen::Vector3d::UnitZ());
  Observation z;
  z.rows = 3;
  z.residual = force_mps2 - kGravity_mps2 * R_base_map.col(2) - accel_base_mps2 - x.accel_bias;
  z.R = sigma_mps2 * sigma_mps2 * Eigen::Matrix3d::Identity();
  for (int i = 0; i < 3; ++i) {
    z.set(i, kAtt, by_attitude(i, 0));
    z.set(i, kAtt + 1, by_attitude(i, 1));
    z.set(i, kAccelBias + i, 1.0);
  }
  return z;
}

Observation Model::pose(const State& x, const PoseWithCovariance& T_map_base) const {
  Observation z;
  z.rows = 3;
  z.residual << T_map_base.mean.x - x.p.x(), T_map_base.mean.y - x.p.y(),
      angleDiff(T_map_base.mean.phi, x.yaw());
  z.R = T_map_base.cov;
  z.set(0, kPos, 1.0);
  z.set(1, kPos + 1, 1.0);
  z.set(2, kAtt + 2, 1.0);
  return z;
}

Observation Model::zeroRate(
    const State& x, const Eigen::Vector3d& omega_radps, double sigma_radps) const {
  Observation z;
  z.R = sigma_radps * sigma_radps * Eigen::Matrix3d::Identity();
  for (int i = planar_ ? 2 : 0; i < 3; ++i) {
    z.residual[z.rows] = omega_radps[i] - x.gyro_bias[i];
    z.set(z.rows, kGyroBias + i, 1.0);
    ++z.rows;
  }
  return z;
}

Observation Model::nonHolonomic(
    const State& x, double omega_z_radps, double sigma_left_mps, double sigma_up_mps) const {
  const Eigen::Matrix3d R_base_map = x.q.conjugate().toRotationMatrix();
  const Eigen::Vector3d v_base = R_base_map * x.v;
  const Eigen::Matrix3d by_attitude = R_base_map * skew(x.v);
  const double omega = omega_z_radps - x.gyro_bias.z();
  Observation z;
  z.rows = planar_ ? 1 : 2;
  z.residual << -v_base.y() - omega * x.icr_x, -v_base.z(), 0.0;
  z.R.diagonal() << sigma_left_mps * sigma_left_mps, sigma_up_mps * sigma_up_mps, 1.0;
  for (int i = 0; i < z.rows; ++i) {
    for (int j = 0; j < 3; ++j) {
      z.set(i, kVel + j, R_base_map(i + 1, j));
      z.set(i, kAtt + j, by_attitude(i + 1, j));
    }
  }
  z.set(0, kIcrX, omega);
  z.set(0, kGyroBias + 2, -x.icr_x);
  return z;
}

Observation Model::wheelTurn(
    const State& x,
    double wheel_turn_rad,
    double gyro_turn_rad,
    double forward_m,
    double dt_s,
    double sigma_rad) const {
  const double ratio = std::exp(x.track);
  const double turn = gyro_turn_rad - x.gyro_bias.z() * dt_s - x.wheel_skew * forward_m;
  Observation z;
  z.rows = 1;
  z.residual[0] = wheel_turn_rad - ratio * turn;
  z.R(0, 0) = sigma_rad * sigma_rad;
  z.set(0, kTrack, ratio * turn);
  z.set(0, kWheelSkew, -ratio * forward_m);
  return z;
}

}  // namespace vestibule::ekf
