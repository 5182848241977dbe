#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/ekf/params.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::ekf {

/// What a fix is worth before it meets the estimate, and what to do when fixes keep being refused.
class GnssScreen {
 public:
  GnssScreen(const FilterParams& params, const Point2& p_base_antenna)
      : params_(params), p_base_antenna_(p_base_antenna) {}

  struct Worth {
    std::string refused;  ///< why the fix cannot be used at all; empty otherwise
    Eigen::Matrix2d R = Eigen::Matrix2d::Zero();  ///< of this one fix
    double inflation = 1.0;  ///< of R when used: its error is mostly that of the fix before
    double sigma_m = 0.0;    ///< larger axis
  };
  /// Notes the stamp: silence before a fix makes the next ones doubtful.
  [[nodiscard]] Worth assess(
      Timestamp stamp,
      const std::optional<Eigen::Matrix2d>& cov,
      GnssFixType type,
      std::optional<double> hdop,
      std::optional<int> satellites);

  void accepted(Timestamp stamp);
  struct Cluster {
    Eigen::Vector2d p_map_base;
    Eigen::Matrix2d cov;
  };
  /// Keeps a refused fix. When enough of them moved as the odometry did, where they put the robot.
  [[nodiscard]] std::optional<Cluster> refused(
      Timestamp stamp,
      const Eigen::Vector2d& p_map_antenna,
      double sigma_m,
      const Pose2& T_odom_base,
      double yaw_map_base);
  void forget();

 private:
  struct Candidate {
    Timestamp stamp;
    Eigen::Vector2d p_map_antenna;
    Pose2 T_odom_base;
    double sigma_m;
  };

  FilterParams params_;
  Point2 p_base_antenna_;
  std::optional<Timestamp> last_fix_;
  std::optional<Timestamp> last_used_;
  std::optional<Timestamp> doubtful_until_;
  std::deque<Candidate> candidates_;
};

}  // namespace vestibule::ekf
