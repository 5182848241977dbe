#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/ekf/params.hpp"

namespace vestibule::ekf {

/// Finds T_map_odom from antenna positions in map and the same moments in odom: a robust rigid fit
/// of the two tracks. Fixes at one place count once, since their errors are one and the same.
class TrackAlignment {
 public:
  /// \param params outlives it and its copies
  explicit TrackAlignment(const FilterParams& params) : params_(&params) {}

  struct Result {
    Pose2 T_map_odom;
    double position_sigma_m = 0.0;  ///< of the newest position in map
    double yaw_sigma_rad = 0.0;
  };

  void add(
      Timestamp stamp,
      const Eigen::Vector2d& p_map_antenna,
      const Point2& p_odom_antenna,
      double sigma_m);
  /// Empty until the track is long enough and the two agree.
  [[nodiscard]] std::optional<Result> solve() const;
  [[nodiscard]] std::size_t size() const { return fixes_.size(); }
  /// Largest distance of a fix from the newest one, by odometry [m].
  [[nodiscard]] double extent() const;

 private:
  struct Fix {
    Timestamp stamp;
    Eigen::Vector2d p_map;
    Eigen::Vector2d p_odom;
    double sigma_m;
  };

  const FilterParams* params_;
  std::deque<Fix> fixes_;
  Eigen::Vector2d anchor_odom_ = Eigen::Vector2d::Zero();  ///< where the newest was begun
};

}  // namespace vestibule::ekf
