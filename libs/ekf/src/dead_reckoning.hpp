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
  /// \param params outlives it and its copies
  explicit DeadReckoning(const FilterParams& params) : params_(&params) {}

  /// Usable: finite and not older than time().
  [[nodiscard]] bool stale(Timestamp stamp) const { return started_ && stamp < time_; }

  /// \pre finite, not stale
  [[nodiscard]] Motion process(const WheelOdometry& wheels);
  /// \param gyro_bias_radps  estimate, to tell standing from turning
  [[nodiscard]] Motion process(const Imu& imu, const Eigen::Vector3d& gyro_bias_radps);
  /// The step to `stamp` with everything held. \pre not stale
  [[nodiscard]] Motion advance(Timestamp stamp);
  /// The same without taking it.
  [[nodiscard]] Motion ahead(Timestamp stamp) const { return DeadReckoning(*this).advance(stamp); }

  [[nodiscard]] bool started() const { return started_; }
  [[nodiscard]] Timestamp time() const { return time_; }
  [[nodiscard]] double speed() const { return speed_forward_; }
  /// Gyro reading where there is a gyro, else the wheels' rate; base axes (in the plane: z only).
  [[nodiscard]] Eigen::Vector3d rate() const;
  /// By the last IMU message that had it, at the base [m/s^2].
  [[nodiscard]] const Eigen::Vector3d& force() const { return force_mps2_; }
  /// Whether the last IMU message had a full accelerometer's reading.
  [[nodiscard]] bool hasForce() const { return has_force_; }
  /// Of the robot itself by its wheels and turn rate, base axes [m/s^2].
  [[nodiscard]] Eigen::Vector3d ownAcceleration(const Eigen::Vector3d& gyro_bias_radps) const;
  /// The wheels slip: for a while they say little.
  void slipped() { slips_until_ = time_ + kSlip; }
  /// What a step that coasted moved the robot forward, for the wheels to catch up with.
  void coasted(double forward_m) { held_forward_m_ += forward_m; }

  /// The last wheel message against the gyro over the same time.
  struct WheelTurn {
    double wheels_rad = 0.0;
    double gyro_rad = 0.0;  ///< bias included
    double forward_m = 0.0;
    double dt_s = 0.0;
  };
  /// Empty when there was no gyro all the time.
  [[nodiscard]] const std::optional<WheelTurn>& wheelTurn() const { return wheel_turn_; }
  [[nodiscard]] bool rateIsGyro() const { return gyroAlive(time_); }
  [[nodiscard]] bool standstill() const;

 private:
  static constexpr Duration kSlip = std::chrono::milliseconds(500);
  [[nodiscard]] bool wheelsAlive(Timestamp stamp) const;
  [[nodiscard]] bool gyroAlive(Timestamp stamp) const;
  void start(Timestamp stamp);
  void turn(Motion& u, bool gyro, const Eigen::Vector3d& gyro_turn_rad, double wheel_turn_rad);
  void addNoise(Motion& u) const;
  /// Specific force at the base of a reading taken beside it.
  [[nodiscard]] Eigen::Vector3d forceAtBase(const Imu& imu, double interval_s) const;
  /// The turn rate as the model wants it: in the plane, about the vertical, however the sensor is
  /// mounted.
  [[nodiscard]] Eigen::Vector3d rateOf(const Imu& imu, double interval_s);

  const FilterParams* params_;
  bool started_ = false;
  std::optional<Timestamp> slips_until_;
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
  Eigen::Vector3d gyro_rate_ = Eigen::Vector3d::Zero();
  double gyro_change_sq_ = 0.0;  ///< running mean square of the change between samples, about z
  Eigen::Vector3d held_gyro_turn_ = Eigen::Vector3d::Zero();  ///< since the last gyro message
  double gyro_turn_since_wheels_ = 0.0;
  bool gyro_since_wheels_ = false;
  std::optional<WheelTurn> wheel_turn_;
  Eigen::Vector3d force_mps2_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d raw_rate_ = Eigen::Vector3d::Zero();  ///< of the last IMU message
  bool has_force_ = false;
  double wheel_acceleration_mps2_ = 0.0;
  bool gyro_still_ = true;
  Eigen::Vector3d up_imu_ = Eigen::Vector3d::Zero();  ///< running mean specific force [m/s^2]
  int up_samples_ = 0;
};

}  // namespace vestibule::ekf
