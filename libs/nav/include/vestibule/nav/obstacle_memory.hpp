#pragma once

#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/nav/command_mux.hpp"

namespace vestibule::nav {

struct ObstacleMemoryParams {
  double radius_m = 2.0;    ///< [m] what is farther from the base is forgotten
  double max_age_s = 30.0;  ///< [s]
  double spacing_m = 0.05;  ///< [m] points nearer to each other than this are one
};
void describe(ParamIo& io, ObstacleMemoryParams& params);

/// Remembers obstacles that have slipped out of the lidar's view beside and behind the robot, where
/// its rear corners swing when it turns. A remembered point goes when the lidar looks in its
/// direction again (whatever is there now is in the scan), with age and distance, and when the
/// robot itself stands on it. Kept in the odometry frame: corrections of the map pose do not move
/// it.
///
/// A single stray echo (dust, rain, a mixed pixel) is no obstacle: an echo without a neighbour
/// counts only if the scan before had one at the same place.
class ObstacleMemory {
 public:
  ObstacleMemory(const ObstacleMemoryParams& params, const Footprint& footprint);

  /// Takes one scan (its end points in the base frame, in beam order) and gives them, less the
  /// strays, with the remembered ones.
  ///
  /// \param p_base_laser from where the scan was taken
  [[nodiscard]] std::vector<Point2> update(
      Timestamp stamp,
      const Pose2& T_odom_base,
      const std::vector<Point2>& scan_base,
      const Point2& p_base_laser);

 private:
  [[nodiscard]] std::vector<Point2> withoutStrays(
      const Pose2& T_odom_base, const std::vector<Point2>& scan_base, const Point2& p_base_laser);

  struct Remembered {
    Point2 p_odom;
    Timestamp seen;
    int scans = 0;  // how many scans have confirmed it
  };
  ObstacleMemoryParams params_;
  Footprint footprint_;
  std::vector<Remembered> points_;
  std::vector<Point2> previous_scan_odom_;
  bool has_previous_ = false;
};

}  // namespace vestibule::nav
