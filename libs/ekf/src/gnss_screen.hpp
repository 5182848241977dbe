#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>
#include <string>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/ekf/filter.hpp"
#include "vestibule/ekf/params.hpp"

namespace vestibule::ekf {

/// Kinds of fixes that err alike.
enum class FixKind { kCode, kDifferential, kCarrierPhase };

/// How the error of a kind of fixes goes on in time.
struct GnssErrorModel {
  double slow_share = 0.0;     ///< of sigma, estimated; the rest is white
  double correlation_s = 0.0;  ///< of the slow part
  double repeat_s = 0.0;       ///< so long the white part stays the same
};
[[nodiscard]] GnssErrorModel errorModel(FixKind kind, const GnssParams& params);

/// What a fix is worth before it meets the estimate, and what to do when fixes keep being refused.
class GnssScreen {
 public:
  /// \param params outlives it and its copies
  GnssScreen(const FilterParams& params, const Point2& p_base_antenna)
      : params_(&params), p_base_antenna_(p_base_antenna) {}

  struct Worth {
    std::string refused;  ///< why the fix cannot be used at all; empty otherwise
    Eigen::Matrix3d R = Eigen::Matrix3d::Zero();  ///< of this one fix, doubts included
    double sigma_m = 0.0;                         ///< horizontal, larger axis, without doubts
    FixKind kind = FixKind::kCode;
    double repeats = 1.0;  ///< so many fixes in a row say the same
  };
  /// Notes the stamp: silence before a fix makes the next ones doubtful.
  [[nodiscard]] Worth assess(const MapFix& fix);
  /// Whether the robot would have had to be faster than any since the last accepted fix.
  [[nodiscard]] bool tooFast(const MapFix& fix, double sigma_m) const;

  void accepted(const MapFix& fix);
  struct Cluster {
    Eigen::Vector2d p_map_base;
    Eigen::Matrix2d cov;
  };
  /// Keeps a refused fix. When enough of them moved as the odometry did, where they put the robot.
  [[nodiscard]] std::optional<Cluster> refused(
      const MapFix& fix, double sigma_m, const Pose2& T_odom_base, double yaw_map_base);
  void forget();

 private:
  struct Candidate {
    Timestamp stamp;
    Eigen::Vector2d p_map_antenna;
    Pose2 T_odom_base;
    double sigma_m;
  };

  const FilterParams* params_;
  Point2 p_base_antenna_;
  std::optional<Timestamp> last_fix_;
  std::optional<Timestamp> last_used_;
  Eigen::Vector2d last_used_at_ = Eigen::Vector2d::Zero();
  std::optional<Timestamp> doubtful_until_;
  std::deque<Candidate> candidates_;
};

}  // namespace vestibule::ekf
