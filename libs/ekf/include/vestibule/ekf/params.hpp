#pragma once

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"

namespace vestibule::ekf {

/// How the wheels err. The yaw of the wheels is used only while there is no gyro.
struct WheelParams {
  double distance_sigma_sqrt_m = 0.05;  ///< [m/sqrt(m)] random walk along the path
  double lateral_sigma_sqrt_m = 0.03;   ///< [m/sqrt(m)] the same sideways (skidding)
  double yaw_sigma_per_rad = 0.15;      ///< [-] of a turn measured by the wheels
  double yaw_sigma_sqrt_m = 0.01;       ///< [rad/sqrt(m)] of the wheels' yaw on a straight
  double scale_sigma = 0.08;            ///< [-] of the true distance per wheel distance, at start
  double scale_walk_sqrt_m = 2e-4;      ///< [1/sqrt(m)] its drift
  double max_gap_s = 0.5;  ///< [s] a longer silence than this (or 2.5 periods) = dropout
  double dropout_speed_sigma_mps = 0.7;  ///< [m/s] what the robot may do meanwhile
};

struct GyroParams {
  double noise_rad_sqrt_s = 0.002;  ///< [rad/sqrt(s)] angle random walk
  double scale_sigma = 0.01;        ///< [-] of a turn
  double bias_sigma_radps = 0.01;   ///< [rad/s] at start
  double bias_walk_radps_sqrt_s = 2e-5;
  double max_gap_s = 0.5;  ///< [s] a longer silence (or 2.5 periods) = no gyro: wheels turn
};

/// Absolute heading (compass, IMU orientation). The filter estimates the sensor's offset, so only
/// its changes and, weakly, its value count.
struct HeadingParams {
  double sigma_rad = degToRad(1.0);  ///< [rad] white noise, floor of the reported one
  /// [rad/sqrt(s)] drift of mounting + declination
  double offset_walk_rad_sqrt_s = degToRad(0.05);
  /// [rad] of mounting + declination, if the first readings agree with the track (within two
  /// sigma); a sensor that does not agree has an unknown offset.
  double offset_sigma_rad = degToRad(10.0);
  double disturbance_sigma_rad = degToRad(18.0);  ///< [rad] passing deviation (steel, tilt)
  double disturbance_time_s = 25.0;               ///< [s] how long such a deviation lasts
  double relearn_after_s = 1.5;                   ///< [s] rejected so long: offset learnt anew
};

/// Floors of the standard deviation per axis by fix type, and how fixes are believed.
struct GnssParams {
  double sigma_rtk_fixed_m = 0.03;
  double sigma_rtk_float_m = 0.4;
  double sigma_differential_m = 1.0;
  double sigma_single_m = 4.0;  ///< also for receivers that do not say what they have
  double uere_m = 2.5;          ///< [m] sigma = hdop * uere
  double correlation_s = 60.0;  ///< [s] errors within it are one and the same; code fixes
  double rtk_correlation_s = 2.0;
  double gap_s = 3.0;         ///< [s] after a longer silence fixes are doubted (x3) for 5 s
  double max_sigma_m = 50.0;  ///< [m] a fix that says it is worse is rejected
};

/// Re-acquisition after rejections: a cluster of fixes that moves as the odometry does.
struct RecoveryParams {
  int min_fixes = 20;
  double min_span_s = 40.0;
  double min_travel_m = 25.0;
  /// [s] nothing accepted for so long: the heading is doubted as well, and the odometry track since
  /// then is aligned anew with the fixes, as at the start.
  double realign_after_s = 90.0;
};

/// When position and heading are known well enough to start.
struct InitParams {
  double max_yaw_sigma_rad = degToRad(10.0);
  double min_travel_m = 8.0;  ///< [m] extent of the odometry track before aligning it
  int min_fixes = 5;
  /// Start from the heading sensor at the first good fix, without driving. For sensors known to be
  /// mounted and calibrated well.
  bool trust_heading = false;
};

struct FilterParams {
  double gate_probability = 0.999;        ///< a good measurement passes with this probability
  double down_weight_probability = 0.95;  ///< beyond it the variance grows with the error
  double standstill_s = 0.5;              ///< [s] wheels at rest for so long = standing
  double standstill_speed_mps = 0.01;
  double standstill_rate_radps = 0.05;  ///< gyro (less bias) below it
  WheelParams wheels;
  GyroParams gyro;
  HeadingParams heading;
  GnssParams gnss;
  RecoveryParams recovery;
  InitParams init;
};

void describe(ParamIo& io, WheelParams& p);
void describe(ParamIo& io, GyroParams& p);
void describe(ParamIo& io, HeadingParams& p);
void describe(ParamIo& io, GnssParams& p);
void describe(ParamIo& io, RecoveryParams& p);
void describe(ParamIo& io, InitParams& p);
void describe(ParamIo& io, FilterParams& p);

}  // namespace vestibule::ekf
