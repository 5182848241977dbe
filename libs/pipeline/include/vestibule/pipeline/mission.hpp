#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "vestibule/core/events.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/metrics/trajectory.hpp"
#include "vestibule/metrics/transition.hpp"
#include "vestibule/nav/mission.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/indoor_maps.hpp"
#include "vestibule/pipeline/progress.hpp"
#include "vestibule/sim/simulator.hpp"
#include "vestibule/sim/world.hpp"

namespace vestibule::pipeline {

/// Everything a mission needs, loaded and checked against each other.
struct MissionSetup {
  nav::Mission mission;
  geo::Site site;
  sim::World world;
  sim::SimParams sim;
  std::vector<grid::MapRectangle> map_rectangles;  ///< as of surveyIndoorMaps()
  std::vector<std::string> map_notes;
};

/// Throws ConfigError listing every problem: files, waypoints in walls, a world that is not at the
/// site.
[[nodiscard]] MissionSetup loadMissionSetup(
    const std::string& mission_path, const std::string& world_path, const Config& config);

/// What the mission task `photo` wants drawn.
struct PhotoRequest {
  Timestamp stamp;
  std::string file;
  std::string waypoint;
  Pose2 T_map_base;  ///< as published
  std::vector<Point2> p_base_scan;
  std::vector<MapPtr> maps;  ///< those in memory
};

struct MissionHooks {
  std::function<void(const PhotoRequest&)> photo;
  /// Every measurement the robot gets, in the order it gets it, for a recording.
  std::function<void(const Measurement&)> measurement;
};

struct WaypointResult {
  std::string path;
  std::string name;
  bool reached = false;
  Timestamp stamp;
  double true_miss_m = 0.0;  ///< true distance to the waypoint when it counted as reached
};

struct ErrorFigures {
  std::size_t count = 0;
  double rmse_m = 0.0;
  double max_m = 0.0;
  double max_yaw_rad = 0.0;
};

struct MissionResult {
  bool done = false;
  std::string abort_reason;  ///< empty when done
  std::vector<WaypointResult> waypoints;
  bool in_order = false;  ///< all reached, in the order of the mission
  bool collided = false;
  double min_clearance_m = 0.0;  ///< of the footprint in the true world
  double duration_s = 0.0;       ///< simulated
  double distance_m = 0.0;       ///< truly driven
  metrics::Trajectory published;
  metrics::Trajectory odometry;
  metrics::Trajectory truth;
  metrics::Step correction;  ///< largest within 100 ms, at the base
  ErrorFigures error;        ///< of the published pose, whole run
  ErrorFigures door_zone;    ///< within 10 m of a door
  int mode_switches = 0;
  MapChanges map_changes;
  int recoveries = 0;
};

/// Drives the mission in the simulator, in closed loop, until it ends.
[[nodiscard]] MissionResult runMission(
    const MissionSetup& setup,
    const Config& config,
    const Observers& observers,
    const MissionHooks& hooks,
    const Progress& progress);

}  // namespace vestibule::pipeline
