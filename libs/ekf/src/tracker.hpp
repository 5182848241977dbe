#pragma once

#include <memory>
#include <optional>

#include "vestibule/ekf/engine.hpp"
#include "vestibule/ekf/filter.hpp"

namespace vestibule::ekf {

/// Limits of a chi-square test, computed once.
class Gate {
 public:
  explicit Gate(const FilterParams& params);
  [[nodiscard]] double limit(int dof) const { return limit_[dof - 1]; }
  [[nodiscard]] double soft(int dof) const { return soft_[dof - 1]; }

 private:
  double limit_[3];
  double soft_[3];
};

/// One engine with what both filters do to it: steps, gated updates, the heading sensor's offset.
class Tracker {
 public:
  enum class Pose {
    kCorrected,  ///< every update moves the pose as the Kalman equations say
    kContinuous  ///< position follows the motion alone: an update may turn it, never shift it
  };
  Tracker(const FilterParams& params, Pose mode);

  /// Starts from a pose; wheel scale and gyro bias as given, heading offset unknown.
  void start(
      const PoseWithCovariance& T,
      const Eigen::Vector2d& bias_mean_var,
      const Eigen::Vector2d& scale_mean_var);
  void step(const Motion& u) { engine_->predict(u); }
  /// \param inflation  of R when the measurement is used; the test is against R itself
  UpdateReport offer(Observation z, double inflation = 1.0);
  UpdateReport offerHeading(const Heading& heading);
  void zeroRate(double omega_radps, double interval_s);
  /// Moves the position, forgetting what was known of it.
  void resetPosition(const Eigen::Vector2d& p, const Eigen::Matrix2d& cov);

  [[nodiscard]] State state() const { return engine_->state(); }
  [[nodiscard]] StateMatrix covariance() const { return engine_->covariance(); }
  [[nodiscard]] PoseWithCovariance pose() const;
  /// Mean and variance of one state.
  [[nodiscard]] Eigen::Vector2d marginal(int index) const;

 private:
  void learnHeadingOffset(double mean_rad, double sigma_rad);
  void update(const Observation& z);

  FilterParams params_;
  Pose mode_;
  Gate gate_;
  std::unique_ptr<Engine> engine_;
  bool heading_known_ = false;
  std::optional<Timestamp> heading_rejected_since_;
};

}  // namespace vestibule::ekf
