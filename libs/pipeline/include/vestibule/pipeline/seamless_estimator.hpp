#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vestibule/amcl/map_localizers.hpp"
#include "vestibule/core/events.hpp"
#include "vestibule/ekf/filter.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/mode_manager/mode_manager.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/indoor_maps.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::pipeline {

/// A start pose told by someone who knows the place, e.g. a surveyed charging point: good to 0.15 m
/// and 2 deg.
[[nodiscard]] PoseWithCovariance toldStart(const Pose2& T_map_base);

/// Wires odometry filter, GNSS filter, particle localization and mode manager: measurements in
/// stamp order go in, one published pose comes out. The same object serves recordings and the
/// closed loop.
class SeamlessEstimator {
 public:
  /// \param map_rectangles as of surveyIndoorMaps()
  SeamlessEstimator(
      const Config& config,
      const geo::Site& site,
      const std::vector<grid::MapRectangle>& map_rectangles,
      const Observers& observers);

  /// Starts from a known pose, e.g. the charging point.
  void start(Timestamp stamp, const PoseWithCovariance& T_map_base);
  void process(const Measurement& measurement);

  /// The indoor maps in memory: those near the robot.
  [[nodiscard]] std::vector<MapPtr> maps() const { return maps_.loaded(); }

  [[nodiscard]] bool ready() const { return manager_.ready(); }
  /// What the GNSS filter still misses for a first pose, in words; empty when it has one.
  [[nodiscard]] std::string waitingFor() const { return gnss_filter_.waitingFor(); }
  /// Stamp of the last odometry message.
  [[nodiscard]] Timestamp time() const { return time_; }
  [[nodiscard]] const Pose2& T_odom_base() const { return T_odom_base_; }
  [[nodiscard]] double speed() const { return gnss_filter_.speed(); }
  [[nodiscard]] double yawRate() const { return gnss_filter_.yawRate(); }
  [[nodiscard]] mode_manager::ModeManager& modeManager() { return manager_; }
  [[nodiscard]] const mode_manager::ModeManager& modeManager() const { return manager_; }

 private:
  void onWheels(const WheelOdometry& wheels);
  void onFix(const GnssFix& fix);
  void onScan(const LaserScan& scan);
  void seedParticles();

  Config config_;
  std::optional<geo::TangentPlane> plane_;  // at the site's datum
  const Observers& observers_;

  ekf::MapFilter gnss_filter_;  // with the odometry filter inside
  amcl::MapLocalizers localizers_;
  IndoorMaps maps_;
  mode_manager::ModeManager manager_;

  Timestamp time_;
  Pose2 T_odom_base_;
  bool has_gyro_ = false;
  std::optional<Timestamp> last_fix_;
  std::optional<Timestamp> last_map_pose_to_filter_;
};

}  // namespace vestibule::pipeline
