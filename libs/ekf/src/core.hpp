#pragma once

#include <array>
#include <optional>
#include <string>

#include "alignment.hpp"
#include "dead_reckoning.hpp"
#include "gnss_drift.hpp"
#include "gnss_screen.hpp"
#include "heading_bank.hpp"
#include "inputs.hpp"
#include "noise_scale.hpp"
#include "rest_noise.hpp"
#include "tracker.hpp"

namespace vestibule::ekf {

/// The filter without history: takes inputs in the order of their stamps. A value: copies go on
/// independently, which is how the history goes back in time.
class Core {
 public:
  /// \param shared, rig outlive it and its copies
  Core(const Shared& shared, const SensorRig& rig);

  /// \pre usable and not older than time()
  UpdateReport apply(const Input& input);

  [[nodiscard]] Timestamp time() const { return reckoning_.time(); }
  [[nodiscard]] bool started() const { return reckoning_.started(); }
  [[nodiscard]] const DeadReckoning& reckoning() const { return reckoning_; }
  [[nodiscard]] const Tracker& odometry() const { return odometry_; }
  [[nodiscard]] const Tracker& map() const { return map_; }
  [[nodiscard]] bool ready() const { return ready_; }
  [[nodiscard]] std::string waitingFor() const;
  [[nodiscard]] const std::optional<PoseWithCovariance>& initialAlignment() const {
    return initial_alignment_;
  }
  void record(Tape* tape) { map_.attach(tape); }
  /// Goes on to the fix's stamp. See MapFilter::expected.
  [[nodiscard]] MapFilter::Expected expected(const MapFix& fix);

 private:
  UpdateReport take(const Imu& imu);
  UpdateReport take(const Heading& heading);
  UpdateReport take(const WheelOdometry& wheels);
  UpdateReport take(const MapFix& fix);
  UpdateReport take(const VelocityInput& input);
  UpdateReport take(const PoseInput& pose);
  UpdateReport take(const ResetInput& reset);

  void step(Motion&& u);
  /// To a stamp at which nothing is said of the motion, covariances included.
  void advance(Timestamp stamp);
  void begin(const PoseWithCovariance& T_map_base);
  /// Starts where a fix puts a base of this yaw.
  void begin(const MapFix& fix, const Eigen::Matrix3d& R, double yaw_rad, double yaw_sigma_rad);
  /// Starts from the odometry track aligned to the fixes.
  void begin(const TrackAlignment::Result& found, const MapFix& fix);
  UpdateReport initialise(const MapFix& fix, const GnssScreen::Worth& worth);
  UpdateReport fuse(const MapFix& fix, const GnssScreen::Worth& worth);
  [[nodiscard]] GnssDrift::Fix seenByBoth(const MapFix& fix) const;
  [[nodiscard]] double driftNis(const MapFix& fix, const GnssScreen::Worth& worth) const;
  /// Tries to find the pose again from fixes that were all refused.
  bool recover(const MapFix& fix, const GnssScreen::Worth& worth);
  /// Carrier-phase fixes that creep away from the estimate are right: it is the motion that is
  /// wrong. \return whether to test the fix again
  bool doubtMotion(
      const MapFix& fix, const GnssScreen::Worth& worth, const Tracker::GnssTest& test);
  [[nodiscard]] NoiseScale& fixNoise(FixKind kind) {
    return fix_noise_[static_cast<std::size_t>(kind)];
  }
  void setGnssNoise(const GnssScreen::Worth& worth);
  void trustGnss(const MapFix& fix);
  [[nodiscard]] const FilterParams& params() const { return shared_->params; }

  const Shared* shared_;
  const SensorRig* rig_;
  DeadReckoning reckoning_;
  Tracker odometry_;
  Tracker map_;
  TrackAlignment alignment_;    ///< from the start until ready
  HeadingBank bank_;            ///< likewise
  TrackAlignment realignment_;  ///< of fixes refused in a row
  GnssScreen screen_;
  GnssDrift drift_;
  std::array<NoiseScale, 3> fix_noise_;  ///< by FixKind
  NoiseScale velocity_noise_;
  RestNoise rest_noise_;
  std::optional<Timestamp> last_imu_;
  std::optional<Timestamp> last_heading_;
  std::optional<Timestamp> refused_since_;
  std::optional<Timestamp> jumped_since_;
  struct Miss {
    Timestamp stamp;
    Eigen::Vector2d by_m;
  };
  std::optional<Miss> last_miss_;         ///< of a fix from the estimate
  std::optional<Timestamp> crept_since_;  ///< fixes are refused since then, creeping
  bool creeping_ = false;  ///< since the last used fix, they moved away from it without a jump
  std::optional<FixKind> fix_kind_;  ///< of the last fix
  std::optional<Heading> heading_;
  struct UsableFix {
    MapFix fix;
    Eigen::Matrix3d R;
  };
  std::optional<UsableFix> last_fix_;  ///< until ready
  std::optional<Timestamp> last_velocity_;
  bool ready_ = false;
  std::optional<PoseWithCovariance> initial_alignment_;
};

/// One of its two estimates carried on to `stamp` with held speed and rate.
[[nodiscard]] Pose2 carriedOn(
    const Model& model, const Core& core, const State& x, Timestamp stamp);

}  // namespace vestibule::ekf
