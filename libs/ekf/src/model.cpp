#include "vestibule/ekf/model.hpp"

#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule::ekf {
namespace {

/// The step in map axes and what it depends on.
struct Displacement {
  double turn;  ///< bias removed
  double cos;   ///< of the mean heading
  double sin;
  double dx;
  double dy;
};

Displacement displacement(const State& x, const Motion& u) {
  Displacement d{};
  d.turn = u.turn_rad - (u.turn_is_gyro ? x[kGyroBias] * u.dt_s : 0.0);
  const double heading = x[kYaw] + 0.5 * d.turn;
  const double scale = std::exp(x[kWheelScale]);
  d.cos = std::cos(heading);
  d.sin = std::sin(heading);
  d.dx = scale * (d.cos * u.forward_m - d.sin * u.left_m);
  d.dy = scale * (d.sin * u.forward_m + d.cos * u.left_m);
  return d;
}

}  // namespace

State PlanarModel::transition(const State& x, const Motion& u) {
  const Displacement d = displacement(x, u);
  State next = x;
  next[kX] += d.dx;
  next[kY] += d.dy;
  next[kYaw] = wrapToPi(x[kYaw] + d.turn);
  next[kDisturbance] = u.disturbance_decay * x[kDisturbance];
  return next;
}

StateMatrix PlanarModel::jacobian(const State& x, const Motion& u) {
  const Displacement d = displacement(x, u);
  StateMatrix F = StateMatrix::Identity();
  F(kX, kYaw) = -d.dy;
  F(kY, kYaw) = d.dx;
  F(kX, kWheelScale) = d.dx;
  F(kY, kWheelScale) = d.dy;
  F(kDisturbance, kDisturbance) = u.disturbance_decay;
  if (u.turn_is_gyro) {
    F(kYaw, kGyroBias) = -u.dt_s;
    F(kX, kGyroBias) = 0.5 * u.dt_s * d.dy;
    F(kY, kGyroBias) = -0.5 * u.dt_s * d.dx;
  }
  return F;
}

StateMatrix PlanarModel::processNoise(const State& x, const Motion& u) {
  const Displacement d = displacement(x, u);
  // Columns: forward, left, turn. A turn error acts on the mean heading with half its size.
  Eigen::Matrix3d G;
  G << d.cos, -d.sin, -0.5 * d.dy,  //
      d.sin, d.cos, 0.5 * d.dx,     //
      0.0, 0.0, 1.0;
  const Eigen::Vector3d variances(u.forward_var, u.left_var, u.turn_var);
  StateMatrix Q = StateMatrix::Zero();
  Q.topLeftCorner<3, 3>() = G * variances.asDiagonal() * G.transpose();
  Q(kGyroBias, kGyroBias) = u.gyro_bias_var;
  Q(kWheelScale, kWheelScale) = u.wheel_scale_var;
  Q(kHeadingOffset, kHeadingOffset) = u.heading_offset_var;
  Q(kDisturbance, kDisturbance) = u.disturbance_var;
  return Q;
}

Observation PlanarModel::gnss(
    const State& x,
    const Eigen::Vector2d& p_map_antenna,
    const Point2& p_base_antenna,
    const Eigen::Matrix2d& R) {
  const double c = std::cos(x[kYaw]);
  const double s = std::sin(x[kYaw]);
  const Eigen::Vector2d lever(
      c * p_base_antenna.x - s * p_base_antenna.y, s * p_base_antenna.x + c * p_base_antenna.y);
  Observation z;
  z.residual = p_map_antenna - x.head<2>() - lever;
  z.H.setZero(2, kStateSize);
  z.H(0, kX) = 1.0;
  z.H(1, kY) = 1.0;
  z.H(0, kYaw) = -lever.y();
  z.H(1, kYaw) = lever.x();
  z.R = R;
  return z;
}

Observation PlanarModel::heading(const State& x, double yaw_rad, double sigma_rad) {
  Observation z;
  z.residual.setConstant(1, angleDiff(yaw_rad, x[kYaw] + x[kHeadingOffset] + x[kDisturbance]));
  z.H.setZero(1, kStateSize);
  z.H(0, kYaw) = 1.0;
  z.H(0, kHeadingOffset) = 1.0;
  z.H(0, kDisturbance) = 1.0;
  z.R.setConstant(1, 1, sigma_rad * sigma_rad);
  return z;
}

Observation PlanarModel::pose(const State& x, const PoseWithCovariance& T_map_base) {
  Observation z;
  z.residual.resize(3);
  z.residual << T_map_base.mean.x - x[kX], T_map_base.mean.y - x[kY],
      angleDiff(T_map_base.mean.phi, x[kYaw]);
  z.H.setZero(3, kStateSize);
  z.H(0, kX) = 1.0;
  z.H(1, kY) = 1.0;
  z.H(2, kYaw) = 1.0;
  z.R = T_map_base.cov;
  return z;
}

Observation PlanarModel::zeroRate(const State& x, double omega_radps, double sigma_radps) {
  Observation z;
  z.residual.setConstant(1, omega_radps - x[kGyroBias]);
  z.H.setZero(1, kStateSize);
  z.H(0, kGyroBias) = 1.0;
  z.R.setConstant(1, 1, sigma_radps * sigma_radps);
  return z;
}

}  // namespace vestibule::ekf
