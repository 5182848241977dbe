#pragma once

#include <Eigen/Core>

namespace vestibule::amcl {

/// How far a robot had gone on, by the stamp of an odometry reading, since the reading was taken.
/// Readings whose stamps are borrowed from the scan beside them were taken some time before or
/// after it, and much before where a recorder stalled. Robots do not leap: a reading that falls
/// behind and makes it good in the next step was late. This is a Kalman filter over the speed and
/// the missing way.
class MissingWay {
 public:
  MissingWay() { startAnew(); }

  /// The next reading: the way since the one before, forwards, by a stamp dt_s later.
  void take(double along_m, double dt_s);

  [[nodiscard]] double mean_m() const { return missing_m_; }
  [[nodiscard]] double var_m2() const { return cov_(1, 1); }

 private:
  void startAnew();

  double speed_mps_ = 0.0;
  double missing_m_ = 0.0;
  Eigen::Matrix2d cov_;  // speed, missing way
};

}  // namespace vestibule::amcl
