#pragma once

#include <array>
#include <memory>
#include <optional>

#include "vestibule/ekf/engine.hpp"
#include "vestibule/ekf/filter.hpp"
#include "vestibule/ekf/tape.hpp"

namespace vestibule::ekf {

/// Limits of a chi-square test, computed once.
class Gate {
 public:
  explicit Gate(const FilterParams& params);
  [[nodiscard]] double limit(int dof) const { return limit_[static_cast<std::size_t>(dof - 1)]; }
  [[nodiscard]] double soft(int dof) const { return soft_[static_cast<std::size_t>(dof - 1)]; }

 private:
  std::array<double, 3> limit_{};
  std::array<double, 3> soft_{};
};

/// What every copy of a filter shares.
struct Shared {
  explicit Shared(const FilterParams& p);
  FilterParams params;
  Model model;
  Gate gate;
  std::unique_ptr<const Engine> engine;
};

/// One estimate with what both filters do to it: steps, gated updates, the slow errors of heading
/// sensor and GNSS. A value: copies go on independently.
class Tracker {
 public:
  enum class Pose {
    kCorrected,  ///< every update moves the pose as the Kalman equations say
    kContinuous  ///< position follows the motion alone: an update may turn it, never shift it
  };
  /// \param shared outlives it and its copies
  Tracker(const Shared& shared, Pose mode);

  /// Starts at a pose in the plane, the heading sensor's offset unknown. \param learnt  height,
  /// tilt and what is known of wheels and IMU are taken from it; null = nothing is known
  void start(const PoseWithCovariance& T, const Tracker* learnt);
  /// Moves the state. The covariance follows in steps of a tenth of a second, and before whatever
  /// changes it. \param u  the tracker fills in how what it knows itself goes on (disturbance,
  /// offset, slow GNSS error)
  void step(Motion& u);
  /// Brings the covariance to the state's time: before it is only looked at.
  void settle();
  /// \param inflation  of R when the measurement is used; the test is against R itself
  UpdateReport offer(Observation&& z, double inflation = 1.0);
  UpdateReport offerHeading(const Heading& heading);
  void offerTilt(double roll_rad, double pitch_rad, double sigma_rad);
  void offerGravity(const Eigen::Vector3d& force_mps2, const Eigen::Vector3d& own_mps2);
  void offerZeroRate(const Eigen::Vector3d& omega_radps, double sigma_radps);
  UpdateReport offerWheelTurn(double wheels_rad, double gyro_rad, double forward_m, double dt_s);

  // --- GNSS: z = antenna + slow error + white error ---------------------------------------------
  struct GnssNoise {
    double slow_sigma_m = 0.0;
    double correlation_s = 60.0;
    Eigen::Matrix3d white = Eigen::Matrix3d::Identity();
  };
  /// Two tests: against the slow error as it was (a jump), and against any slow error that is
  /// usual (far off).
  struct GnssTest {
    UpdateReport against_any;
    UpdateReport against_last;
    Eigen::Vector2d residual = Eigen::Vector2d::Zero();  ///< [m] against any
  };
  void setGnssNoise(const GnssNoise& noise, bool forget_slow_error);
  [[nodiscard]] GnssTest testGnss(
      const Eigen::Vector3d& p_map_antenna, const Eigen::Vector3d& p_base_antenna) const;
  [[nodiscard]] MapFilter::Expected expectedFix(const Eigen::Vector3d& p_base_antenna) const;
  UpdateReport useGnss(
      const Eigen::Vector3d& p_map_antenna,
      const Eigen::Vector3d& p_base_antenna,
      double inflation);
  void forgetGnssError();
  /// The position came from a fix: its error is that of the fix. \param height_m  if known by it
  void positionFromGnss(std::optional<double> height_m);
  /// The motion was not what the sensors said: the position is a little off. \param turned  the
  /// gyro's bias, and what it did to the heading since then, may be anything usual, too
  void doubtMotion(bool turned);
  /// Moves the position, forgetting what was known of it.
  void resetPosition(const Eigen::Vector2d& p, const Eigen::Matrix2d& cov);

  [[nodiscard]] const State& state() const { return x_; }
  [[nodiscard]] const StateMatrix& covariance() const { return P_; }
  [[nodiscard]] PoseWithCovariance pose() const;
  [[nodiscard]] double sigmaOf(int index) const;
  void attach(Tape* tape) { tape_ = tape; }
  [[nodiscard]] bool usable() const { return x_.allFinite() && P_.allFinite(); }

 private:
  /// The gate alone: what `z` would meet.
  [[nodiscard]] UpdateReport tested(const Observation& z, const Correlation& c) const;
  void learnHeadingOffset(double mean_rad, double sigma_rad);
  /// The heading sensor may be off by anything near `difference_rad`: by its offset, or, where that
  /// is calibrated, by something that passes.
  void doubtHeading(double difference_rad);
  void learnDisturbance(const UpdateReport& report, const Heading& heading, double residual_rad);
  void update(const Observation& z, const Correlation& c);
  void replace(int first, int count, double variance);
  void keepWithinBounds();

  /// What the covariance has not seen yet.
  struct Pending {
    State from;
    Motion motion;
  };

  const Shared* shared_;
  Pose mode_;
  State x_;
  StateMatrix P_ = StateMatrix::Zero();
  Pending pending_;
  bool is_pending_ = false;
  bool heading_known_ = false;
  bool tilt_known_ = false;
  std::optional<Timestamp> heading_rejected_since_;
  std::optional<Timestamp> last_heading_;
  double calibrated_sigma_ = 0.0;  ///< [rad] of the heading's offset; 0: it is not calibrated
  double disturbance_var_ = 0.0;   ///< [rad^2] as usual where the robot drives, learnt
  GnssNoise gnss_;
  Tape* tape_ = nullptr;
};

}  // namespace vestibule::ekf
