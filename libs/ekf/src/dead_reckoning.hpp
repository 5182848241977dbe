#pragma once

#include <optional>

#include "vestibule/core/time.hpp"
#include "vestibule/ekf/model.hpp"
#include "vestibule/ekf/params.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::ekf {

/// Turns wheel and gyro messages, in the order of their stamps, into steps of the model.
///
/// Between messages the last speed and rate are held; a wheel or gyro message then brings the
/// difference between what it measured since its predecessor and what was already held. So a step
/// may end at any stamp, and the sum of all steps is what the sensors measured.
class DeadReckoning {
 public:
  explicit DeadReckoning(const FilterParams& params) : params_(params) {}

  /// Usable: finite and not older than time().
  [[nodiscard]] bool stale(Timestamp stamp) const { return started_ && stamp < time_; }

  /// \pre finite, not stale
  [[nodiscard]] Motion process(const WheelOdometry& wheels);
  /// \param gyro_bias_radps  estimate, to tell standing from turning
  [[nodiscard]] Motion process(const Imu& imu, double gyro_bias_radps);
  /// The step to `stamp` with everything held. \pre not stale
  [[nodiscard]] Motion advance(Timestamp stamp);
  /// The same without taking it.
  [[nodiscard]] Motion ahead(Timestamp stamp) const { return DeadReckoning(*this).advance(stamp); }

  [[nodiscard]] bool started() const { return started_; }
  [[nodiscard]] Timestamp time() const { return time_; }
  [[nodiscard]] double speed() const { return speed_forward_; }
  /// Gyro reading where there is a gyro, else the wheels' rate.
  [[nodiscard]] double rate() const;
  [[nodiscard]] bool rateIsGyro() const { return gyroAlive(time_); }
  [[nodiscard]] bool standstill() const;

 private:
  [[nodiscard]] bool wheelsAlive(Timestamp stamp) const;
  [[nodiscard]] bool gyroAlive(Timestamp stamp) const;
  void start(Timestamp stamp);
  void addNoise(Motion& u) const;
  /// Rate about the vertical, however the sensor is mounted.
  [[nodiscard]] double verticalRate(const Imu& imu, double interval_s);

  FilterParams params_;
  bool started_ = false;
  Timestamp time_;

  std::optional<Timestamp> last_wheels_;
  double wheel_period_s_ = 0.0;
  double speed_forward_ = 0.0;
  double speed_left_ = 0.0;
  double wheel_rate_ = 0.0;
  double held_forward_m_ = 0.0;  ///< since the last wheel message
  double held_left_m_ = 0.0;
  double held_wheel_turn_ = 0.0;
  std::optional<Timestamp> still_since_;

  std::optional<Timestamp> last_imu_;
  double imu_period_s_ = 0.0;
  double gyro_rate_ = 0.0;
  double gyro_change_sq_ = 0.0;  ///< running mean square of the change between samples
  double held_gyro_turn_ = 0.0;  ///< since the last gyro message
  bool gyro_still_ = true;
  Eigen::Vector3d up_imu_ = Eigen::Vector3d::Zero();  ///< running mean specific force [m/s^2]
  int up_samples_ = 0;
};

}  // namespace vestibule::ekf
