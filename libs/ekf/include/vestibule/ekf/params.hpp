#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"

namespace vestibule::ekf {

/// Which quantities of each sensor the filter takes. The names are those of the YAML.
struct UseParams {
  std::vector<std::string> wheels{"speed", "yaw_rate"};
  std::vector<std::string> imu{"yaw_rate", "acceleration"};
  std::vector<std::string> heading{"yaw", "tilt"};
  std::vector<std::string> gnss{"position", "velocity"};

  [[nodiscard]] bool wheelSpeed() const;
  [[nodiscard]] bool wheelYawRate() const;
  [[nodiscard]] bool imuYawRate() const;
  [[nodiscard]] bool imuAcceleration() const;
  [[nodiscard]] bool headingYaw() const;
  [[nodiscard]] bool headingTilt() const;
  [[nodiscard]] bool gnssPosition() const;
  [[nodiscard]] bool gnssVelocity() const;
};

/// How the wheels err. The yaw of the wheels is used only while there is no gyro.
struct WheelParams {
  double distance_sigma_sqrt_m = 0.05;         ///< [m/sqrt(m)] random walk along the path
  double lateral_sigma_sqrt_m = 0.03;          ///< [m/sqrt(m)] the same sideways (skidding)
  double turn_lateral_sigma_m_sqrt_rad = 0.0;  ///< [m/sqrt(rad)] the same in turns, on top
  double yaw_sigma_per_rad = 0.15;             ///< [-] of a turn measured by the wheels
  double yaw_sigma_sqrt_m = 0.01;              ///< [rad/sqrt(m)] of the wheels' yaw on a straight
  double scale_sigma = 0.05;           ///< [-] of the true distance per wheel distance, at start
  double scale_walk_sqrt_m = 2e-4;     ///< [1/sqrt(m)] its drift
  double track_sigma = 0.3;            ///< [-] log of the turn they claim per true turn, at start
  double skew_sigma_rad_per_m = 0.01;  ///< [rad/m] turn when they claim to go straight, at start
  double icr_sigma_m = 0.0;            ///< [m] centre of rotation ahead of the base; 0 = there
  double learn_above_radps = 0.15;     ///< track and centre of rotation need turns
  double max_gap_s = 0.5;  ///< [s] a longer silence than this (or 2.5 periods) = dropout
  double dropout_speed_sigma_mps = 0.7;  ///< [m/s] what the robot may do meanwhile
};

struct GyroParams {
  double noise_rad_sqrt_s = 0.002;  ///< [rad/sqrt(s)] angle random walk
  /// [rad/sqrt(s)] the least at rest, without the vibration of driving. How much it is there, a
  /// stop shows itself.
  double rest_noise_rad_sqrt_s = 0.0005;
  double scale_sigma = 0.01;        ///< [-] of a turn
  double bias_sigma_radps = 0.006;  ///< [rad/s] at start
  double bias_walk_radps_sqrt_s = 2e-5;
  double max_gap_s = 0.5;  ///< [s] a longer silence (or 2.5 periods) = no gyro: wheels turn
};

/// Counts in space only (`plane: false`).
struct AccelParams {
  double noise_mps2_sqrt_hz = 0.05;  ///< [m/s^2/sqrt(Hz)] while it carries the robot
  double tilt_sigma_mps2 = 0.6;      ///< [m/s^2] as a level, with the robot's own motion
  double bias_sigma_mps2 = 0.1;      ///< [m/s^2] at start
  double bias_walk_mps2_sqrt_s = 2e-4;
  /// [m] where it sits, base axes: what turning does to it is taken out.
  std::vector<double> position_m{0.0, 0.0, 0.0};
};

/// Absolute heading (compass, IMU orientation). The filter estimates the sensor's offset, so only
/// its changes and, weakly, its value count.
struct HeadingParams {
  double sigma_rad = degToRad(1.0);  ///< [rad] white noise, floor of the reported one
  /// [rad/sqrt(s)] drift of mounting + declination
  double offset_walk_rad_sqrt_s = degToRad(0.2);
  /// [rad] of mounting + declination, if the first readings agree with the track (within two
  /// sigma); a sensor that does not agree has an unknown offset.
  double offset_sigma_rad = degToRad(10.0);
  /// [rad/sqrt(rad)] what turning does to it: iron on the robot, which bends the field by 5 to 20
  /// degrees. Calibrated ones have none.
  double turn_offset_rad_sqrt_rad = degToRad(10.0);
  double calibrated_offset_time_s = 2000.0;  ///< [s] how long what a calibration leaves of it stays
  double disturbance_sigma_rad =
      degToRad(12.0);                     ///< [rad] passing deviation (steel, tilt), at first
  double disturbance_time_s = 30.0;       ///< [s] how long such a deviation lasts
  double relearn_after_s = 1.5;           ///< [s] rejected so long: offset learnt anew
  double min_interval_s = 0.1;            ///< [s] closer readings err alike and are left out
  double tilt_sigma_rad = degToRad(1.5);  ///< [rad] of roll and pitch, where the sensor has them
};

/// Floors of the standard deviation per axis by fix type, and how fixes are believed.
struct GnssParams {
  double sigma_rtk_fixed_m = 0.03;
  double sigma_rtk_float_m = 0.4;
  double sigma_differential_m = 2.0;
  double sigma_single_m = 4.0;  ///< also for receivers that do not say what they have
  double uere_m = 3.5;          ///< [m] range error: sigma of both axes together = hdop * uere
  /// [-] of sigma: the part that is estimated as a slow error; the rest is white. 0: nothing is
  /// estimated, and all fixes within the correlation time count as one.
  double slow_share = 0.0;
  double correlation_s = 60.0;  ///< [s] how long the slow error lasts; code fixes
  double repeat_s = 10.0;  ///< [s] beside an estimated slow error: how long the rest repeats itself
  double differential_slow_share = 0.9;      ///< [-] the same three of differential fixes (SBAS)
  double differential_correlation_s = 60.0;  ///< [s]
  double differential_repeat_s = 5.0;        ///< [s]
  double rtk_slow_share = 0.0;               ///< and of RTK fixes
  double rtk_correlation_s = 2.0;            ///< [s]
  double gap_s = 3.0;               ///< [s] after a longer silence fixes are doubted (x3) for 5 s
  double max_sigma_m = 50.0;        ///< [m] a fix that says it is worse is rejected
  double max_speed_mps = 20.0;      ///< [m/s] no robot is faster
  double drift_window_s = 60.0;     ///< [s] fixes move as odometry did for so long; 0: not tested
  double relearn_after_s = 3.0;     ///< [s] rejected so long: the slow error is learnt anew
  double velocity_sigma_mps = 0.1;  ///< [m/s] per axis, floor of the reported one
  double adapt_time_s = 60.0;  ///< [s] over which a kind's noise is learnt; 0 = claims are taken
  double adapt_most = 9.0;     ///< [-] of the variance, at most
  double velocity_repeat_s = 0.5;  ///< [s] so long the error of a velocity stays the same
};

/// Re-acquisition after rejections: a cluster of fixes that moves as the odometry does.
struct RecoveryParams {
  int min_fixes = 20;
  double min_span_s = 60.0;
  double min_travel_m = 25.0;
  /// [sigma of the fixes] likewise: reflections agree with each other for minutes, but not over a
  /// way that is long against what fixes err anyway.
  double min_travel_sigmas = 12.0;

  /// [m] for fixes of that sigma.
  [[nodiscard]] double travel(double sigma_m) const {
    return std::max(min_travel_m, min_travel_sigmas * sigma_m);
  }
  /// [s] nothing accepted for so long: the heading is doubted as well, and the odometry track since
  /// then is aligned anew with the fixes, as at the start.
  double realign_after_s = 180.0;
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

enum class EngineKind { kFixed, kMrpt };

struct FilterParams {
  EngineKind engine = EngineKind::kFixed;
  bool plane = true;                      ///< false: height, roll and pitch as well
  double history_s = 2.0;                 ///< [s] data this late still count in full
  double gate_probability = 0.999;        ///< a good measurement passes with this probability
  double down_weight_probability = 0.95;  ///< beyond it the variance grows with the error
  double standstill_s = 0.5;              ///< [s] wheels at rest for so long = standing
  double standstill_speed_mps = 0.01;
  double standstill_rate_radps = 0.05;  ///< gyro (less bias) below it
  UseParams use;
  WheelParams wheels;
  GyroParams gyro;
  AccelParams accel;
  HeadingParams heading;
  GnssParams gnss;
  RecoveryParams recovery;
  InitParams init;
};

void describe(ParamIo& io, UseParams& p);
void describe(ParamIo& io, WheelParams& p);
void describe(ParamIo& io, GyroParams& p);
void describe(ParamIo& io, AccelParams& p);
void describe(ParamIo& io, HeadingParams& p);
void describe(ParamIo& io, GnssParams& p);
void describe(ParamIo& io, RecoveryParams& p);
void describe(ParamIo& io, InitParams& p);
void describe(ParamIo& io, FilterParams& p);

}  // namespace vestibule::ekf
