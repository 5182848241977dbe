#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::nav {

/// A pose to drive to, in the map frame whatever the file gave it in.
struct Waypoint {
  std::string name;
  Pose2 T_map_base;                  ///< yaw is meaningful only if `has_yaw`
  bool has_yaw = false;              ///< the robot turns to it where it stops (end of a path)
  bool geodetic = false;             ///< given as latitude and longitude
  SourceRef source;                  ///< where it stands in the mission file
  double tolerance_m = 0.5;          ///< [m] reached when this near
  double yaw_tolerance_rad = 0.087;  ///< [rad] 5 degrees
};

enum class TaskType { kWait, kInput, kPhoto, kSwitchLocalization };
[[nodiscard]] std::string_view toString(TaskType type);

/// Who shall have authority over the pose from now on; kAuto leaves it to the mode manager.
enum class LocalizationMode { kAuto, kOutdoor, kIndoor };
[[nodiscard]] std::string_view toString(LocalizationMode mode);

/// What to do at the end of a path.
struct Task {
  TaskType type = TaskType::kWait;
  double duration_s = 2.0;                    ///< [s] wait: to stand still this long
  double timeout_s = 30.0;                    ///< [s] input, switch_localization: give up after
  std::string prompt;                         ///< input: shown to the operator
  std::optional<std::string> default_answer;  ///< input: taken when nobody answers
  std::string file;                           ///< photo: name of the picture
  LocalizationMode mode = LocalizationMode::kAuto;  ///< switch_localization
  SourceRef source;
};

struct Path {
  std::string name;
  std::vector<Waypoint> waypoints;
  std::vector<Task> tasks;
};

struct Mission {
  std::string name;
  std::string site_path;                ///< ready to open: relative paths start at the mission file
  std::optional<std::string> sim_path;  ///< simulator configuration it is meant for, if any
  Pose2 T_map_base_start;               ///< where the robot is switched on
  std::vector<Path> paths;
  std::string file;
};

/// Reads and checks a mission file. Everything wrong with it is listed in one ConfigError, one line
/// per problem with file and line. The form:
///
///   name: forage round
///   site: ../sites/farm.yaml          # relative to the mission file
///   sim: ../sim/rtk.yaml              # optional
///   start: {x: 3.0, y: 4.0, yaw_deg: 90.0}
///   paths:
///     - name: to the stable
///       tolerance_m: 0.5              # optional, for the path's waypoints
///       waypoints:
///         charging_exit: [36.8, -2.4, 20.0, 90.0]      # lat, lon [deg], alt [m], yaw [deg, ENU]
///         door_outside: {x: 12.0, y: 3.0, yaw_deg: 0.0, tolerance_m: 0.3}    # map metres
///       task: {type: wait, duration_s: 2.0}            # or a word (task: photo), or a list
///
/// Tasks: {type: wait, duration_s}, {type: input, prompt, default, timeout_s}, {type: photo, file},
/// {type: switch_localization, mode: indoor | outdoor | auto, timeout_s}. The altitude is read and
/// checked, and not used: driving is planar. The yaw may be left out of both forms of a waypoint.
///
/// \param site gives the datum of geodetic waypoints and the outdoor area they must lie in
[[nodiscard]] Mission loadMission(const std::string& path, const geo::Site& site);
/// The same with the site that the mission names.
[[nodiscard]] Mission loadMission(const std::string& path);
/// The same from text; `name` stands for the file in messages and for resolving relative paths.
[[nodiscard]] Mission parseMission(
    const std::string& yaml, const std::string& name, const geo::Site& site);

/// Waypoints inside a mapped wall, or nearer to one than the robot's radius. One message each, with
/// file, line and the clearance that is left. Waypoints that the map does not cover, or has never
/// seen, pass.
///
/// \param map in the site's map frame
[[nodiscard]] std::vector<std::string> checkAgainstMap(
    const Mission& mission, const grid::OccupancyMap& map, double robot_radius_m);

}  // namespace vestibule::nav
