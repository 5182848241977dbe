#pragma once

#include <optional>

#include "vestibule/core/events.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/mode_manager/params.hpp"
#include "vestibule/mode_manager/pose_slewer.hpp"

namespace vestibule::mode_manager {

/// An estimator's opinion: where the base is in the map, together with where the odometry saw it at
/// the same instant.
struct Estimate {
  Timestamp stamp;
  PoseWithCovariance T_map_base;
  Pose2 T_odom_base;
};

/// The arbiter. Estimators propose; it alone decides whose T_map_odom counts, when that changes and
/// why, and it is the only writer of the published T_map_odom. Evidence must last (hysteresis), the
/// published pose is slewed, and an estimator that is not eligible never gets authority: without
/// any the pose is carried on by odometry (dead reckoning), and after `lost_after_m` the robot
/// says that it is lost.
class ModeManager {
 public:
  /// \param site building outlines are the prior; copied
  /// \param observers may be null
  ModeManager(
      const ModeManagerParams& params, geo::Site site, const Observers* observers = nullptr);

  /// The GNSS filter's estimate. \param last_fix stamp of the last accepted fix, if any
  void offerGnss(const Estimate& estimate, std::optional<Timestamp> last_fix);
  /// The particle filter's estimate. \param trust smoothed share of beams that fit the map
  void offerParticles(const Estimate& estimate, double trust);

  /// Decides and slews; call with every odometry output, after the offers of the same stamp.
  void step(Timestamp stamp, const Pose2& T_odom_base);

  /// A mission task or an operator takes the decision away; empty gives it back. A forced mode
  /// holds as soon as its estimator has offered anything, whatever the evidence.
  void force(std::optional<Mode> mode);
  [[nodiscard]] std::optional<Mode> forced() const { return forced_; }

  /// False until the first estimator was eligible.
  [[nodiscard]] bool ready() const { return slewer_.started(); }
  [[nodiscard]] Mode mode() const { return mode_; }
  [[nodiscard]] const Pose2& T_map_odom() const { return slewer_.T_map_odom(); }
  /// T_map_base as published, with the covariance of its source plus what is not slewed yet.
  /// \pre ready()
  [[nodiscard]] PoseWithCovariance published() const;
  /// Still to be corrected, at the base in map axes.
  [[nodiscard]] const Pose2& pendingCorrection() const { return slewer_.pending(); }

  /// Where the particles should be drawn anew, if they should: near a building and not trusted.
  /// Asking clears it.
  [[nodiscard]] std::optional<PoseWithCovariance> takeSeedRequest();
  /// True near a mapped building: the particles run (in shadow or with authority).
  [[nodiscard]] bool particlesWanted() const { return particles_wanted_; }

 private:
  struct Evidence {
    bool gnss = false;
    bool particles = false;
    bool agree = false;  ///< of the two, where both exist
    double mahalanobis2 = 0.0;
    double building_m = 0.0;
  };
  [[nodiscard]] Evidence weigh(Timestamp stamp) const;
  void decide(Timestamp stamp, const Evidence& evidence);
  void enter(Timestamp stamp, Mode mode, const std::string& reason, const Evidence& evidence);
  void updateSeeding(Timestamp stamp, const Evidence& evidence);
  /// True once `condition` has held for `hold_s` without a break.
  [[nodiscard]] static bool heldFor(
      std::optional<Timestamp>& since, bool condition, Timestamp now, double hold_s);
  [[nodiscard]] const std::optional<Estimate>& authority() const;

  ModeManagerParams params_;
  geo::Site site_;
  const Observers* observers_;
  PoseSlewer slewer_;

  std::optional<Estimate> gnss_;
  std::optional<Estimate> particles_;
  std::optional<Timestamp> last_fix_;
  double trust_ = 0.0;

  Mode mode_ = Mode::kOutdoor;
  std::optional<Mode> forced_;
  Pose2 T_odom_base_;
  PoseWithCovariance source_pose_;  ///< of the last authority, for the covariance
  double dead_reckoned_m_ = 0.0;
  bool warned_ = false;

  std::optional<Timestamp> particles_good_since_;
  std::optional<Timestamp> particles_bad_since_;
  std::optional<Timestamp> gnss_good_since_;
  std::optional<Timestamp> gnss_bad_since_;
  std::optional<Timestamp> away_since_;

  bool particles_wanted_ = false;
  std::optional<Timestamp> last_seed_;
  std::optional<PoseWithCovariance> seed_request_;
};

}  // namespace vestibule::mode_manager
