#pragma once

#include "vestibule/core/random.hpp"
#include "vestibule/ekf/model.hpp"

namespace vestibule::ekf {

/// A state of a robot somewhere, tilted where there is space for it.
inline State randomState(RandomStream& random, bool planar) {
  State x;
  const double z = planar ? 0.0 : 1.0;
  x.p = {random.normal(0, 50), random.normal(0, 50), z * random.normal(0, 5)};
  x.v = {random.normal(), random.normal(), z * random.normal(0, 0.1)};
  x.q = attitudeOf(random.uniform(-3.0, 3.0), z * random.normal(0, 0.2), z * random.normal(0, 0.2));
  x.gyro_bias = {z * random.normal(0, 0.01), z * random.normal(0, 0.01), random.normal(0, 0.01)};
  if (!planar) x.accel_bias = {random.normal(0, 0.1), random.normal(0, 0.1), random.normal(0, 0.1)};
  x.wheel_scale = random.normal(0, 0.1);
  x.wheel_skew = random.normal(0, 0.01);
  x.track = random.normal(0, 0.2);
  x.icr_x = random.normal(0, 0.05);
  x.gnss_bias = {random.normal(), random.normal(), z * random.normal()};
  x.heading_offset = random.uniform(-2.0, 2.0);
  x.disturbance = random.normal(0, 0.2);
  return x;
}

/// A step, by gyro or wheels, rolling or (in space only) coasting.
inline Motion randomMotion(RandomStream& random, bool planar, int kind) {
  Motion u;
  u.dt_s = 0.02;
  u.rolling = planar || kind % 4 != 3;
  u.turn_is_gyro = kind % 2 == 1;
  u.forward_m = u.rolling ? random.normal(0, 0.1) : 0.0;
  u.left_m = u.rolling ? random.normal(0, 0.02) : 0.0;
  u.speed_mps = random.normal(0.5, 0.5);
  u.turn_rad = {random.normal(0, 0.01), random.normal(0, 0.01), random.normal(0, 0.05)};
  u.force_mps2 = {random.normal(), random.normal(), random.normal(9.81, 1.0)};
  u.forward_var = 1e-5;
  u.left_var = 4e-6;
  u.up_var = 1e-6;
  u.turn_var = 1e-6;
  u.tilt_var = 2e-6;
  u.speed_var = 1e-3;
  u.gyro_bias_var = 1e-10;
  u.accel_bias_var = 1e-9;
  u.wheel_scale_var = 1e-9;
  u.track_var = 1e-8;
  u.icr_var = 1e-9;
  u.gnss_bias_decay = 0.999;
  u.gnss_bias_var = 1e-3;
  u.heading_offset_var = 1e-8;
  u.disturbance_decay = 0.99;
  u.disturbance_var = 1e-4;
  return u;
}

/// Uncertain in everything the model knows.
inline StateMatrix someCovariance(const Model& model) {
  Error sigma;
  sigma << 2, 2, 1, 0.2, 0.2, 0.1, 0.02, 0.02, 0.3, 0.01, 0.01, 0.01, 0.1, 0.1, 0.1, 0.08, 0.01,
      0.2, 0.05, 1.5, 1.5, 2.0, 0.5, 0.3;
  StateMatrix P = sigma.cwiseAbs2().asDiagonal();
  model.constrain(P);
  return P;
}

}  // namespace vestibule::ekf
