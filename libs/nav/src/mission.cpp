#include "vestibule/nav/mission.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <initializer_list>
#include <set>
#include <utility>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/grid/distance_field.hpp"

namespace vestibule::nav {
namespace {

constexpr double kMaxFromDatum_m = 5000.0;
constexpr double kMaxAltitude_m = 9000.0;

std::string format(const char* pattern, double a, double b = 0.0, double c = 0.0) {
  char buffer[160];
  std::snprintf(buffer, sizeof buffer, pattern, a, b, c);
  return buffer;
}

/// Reads the mission straight from the YAML nodes instead of through ParamIo: a task may be a word,
/// a mapping or a list of both, and the check of a position needs the site.
class MissionReader {
 public:
  MissionReader(std::string file, const geo::Site& site)
      : file_(std::move(file)), site_(site), plane_(site.datum) {}

  Mission read(const YAML::Node& root) {
    Mission mission;
    mission.file = file_;
    if (!root.IsMap()) {
      problem(root, "", "must be a mapping with the keys name, site, start and paths");
      finish();
    }
    checkKeys(root, "", {"name", "site", "sim", "start", "paths"});
    mission.name = text(root, "", "name", true).value_or("");
    if (const auto path = text(root, "", "site", true)) mission.site_path = resolve(*path);
    if (const auto path = text(root, "", "sim", false)) mission.sim_path = resolve(*path);
    if (const YAML::Node start = find(root, "start"); start.IsDefined()) {
      mission.T_map_base_start = readWaypoint(start, "start", 0.5).T_map_base;
    } else {
      problem(root, "start", "missing (required)");
    }
    const YAML::Node paths = find(root, "paths");
    if (!paths.IsDefined()) {
      problem(root, "paths", "missing (required)");
    } else if (!paths.IsSequence() || paths.size() == 0) {
      problem(paths, "paths", "must be a list of at least one path");
    } else {
      readPaths(paths, mission);
    }
    finish();
    return mission;
  }

 private:
  void problem(const YAML::Node& node, const std::string& key, const std::string& what) {
    const int line = node.Mark().is_null() ? 0 : node.Mark().line + 1;
    const std::string subject = key.empty() ? "" : key + ": ";
    problems_.emplace_back(line, file_ + ":" + std::to_string(line) + ": " + subject + what);
  }

  void finish() {
    if (problems_.empty()) return;
    std::stable_sort(problems_.begin(), problems_.end(), [](const auto& a, const auto& b) {
      return a.first < b.first;
    });
    std::string all;
    for (const auto& entry : problems_) all += (all.empty() ? "" : "\n") + entry.second;
    throw ConfigError(all);
  }

  static YAML::Node find(const YAML::Node& map, const std::string& key) {
    for (const auto& entry : map) {
      if (entry.first.IsScalar() && entry.first.Scalar() == key && !entry.second.IsNull()) {
        return entry.second;
      }
    }
    return YAML::Node(YAML::NodeType::Undefined);
  }

  static std::string join(const std::string& path, const std::string& key) {
    return path.empty() ? key : path + "." + key;
  }

  void checkKeys(
      const YAML::Node& map, const std::string& path, const std::vector<std::string>& known) {
    std::set<std::string> seen;
    for (const auto& entry : map) {
      const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "(not a word)";
      if (!seen.insert(key).second) problem(entry.first, join(path, key), "given twice");
      if (std::find(known.begin(), known.end(), key) != known.end()) continue;
      // A forgotten unit is the usual slip: yaw for yaw_deg.
      const auto with_unit = std::find_if(known.begin(), known.end(), [&](const std::string& k) {
        return k.compare(0, key.size() + 1, key + "_") == 0;
      });
      const auto near =
          with_unit != known.end() ? std::optional(*with_unit) : nearestWord(key, known);
      problem(
          entry.first,
          join(path, key),
          near ? "unknown key (did you mean " + *near + "?)" : "unknown key");
    }
  }

  std::optional<std::string> text(
      const YAML::Node& map, const std::string& path, const std::string& key, bool is_required) {
    const YAML::Node node = find(map, key);
    if (!node.IsDefined()) {
      if (is_required) problem(map, join(path, key), "missing (required)");
      return std::nullopt;
    }
    if (node.IsScalar() && !node.Scalar().empty()) return node.Scalar();
    problem(node, join(path, key), "must be text");
    return std::nullopt;
  }

  std::optional<double> number(
      const YAML::Node& node, const std::string& path, double lo, double hi) {
    if (node.IsScalar()) {
      const std::string& scalar = node.Scalar();
      char* end = nullptr;
      const double value = std::strtod(scalar.c_str(), &end);
      if (!scalar.empty() && end == scalar.c_str() + scalar.size() && !std::isnan(value)) {
        if (value >= lo && value <= hi) return value;
        problem(node, path + " = " + scalar, format("must be in [%g, %g]", lo, hi));
        return std::nullopt;
      }
    }
    problem(
        node, path, "must be a number" + (node.IsScalar() ? ", is '" + node.Scalar() + "'" : ""));
    return std::nullopt;
  }

  /// Absent keys keep `value`.
  void optionalNumber(
      const YAML::Node& map,
      const std::string& path,
      const std::string& key,
      double& value,
      double lo,
      double hi) {
    const YAML::Node node = find(map, key);
    if (node.IsDefined()) value = number(node, join(path, key), lo, hi).value_or(value);
  }

  [[nodiscard]] std::string resolve(const std::string& path) const {
    const std::filesystem::path p(path);
    if (p.is_absolute()) return path;
    return (std::filesystem::path(file_).parent_path() / p).lexically_normal().string();
  }

  void readPaths(const YAML::Node& paths, Mission& mission) {
    std::set<std::string> names;
    for (std::size_t i = 0; i < paths.size(); ++i) {
      const YAML::Node node = paths[i];
      const std::string where = "paths[" + std::to_string(i) + "]";
      if (!node.IsMap()) {
        problem(node, where, "must be a mapping with the keys name, waypoints and task");
        continue;
      }
      checkKeys(node, where, {"name", "waypoints", "task", "tolerance_m"});
      Path path;
      path.name = text(node, where, "name", true).value_or("");
      if (!path.name.empty() && !names.insert(path.name).second) {
        problem(find(node, "name"), where + ".name", "another path is called '" + path.name + "'");
      }
      double tolerance_m = Waypoint{}.tolerance_m;
      optionalNumber(node, where, "tolerance_m", tolerance_m, 0.1, 10.0);
      readWaypoints(node, where, tolerance_m, path);
      if (const YAML::Node task = find(node, "task"); task.IsDefined()) {
        readTasks(task, where + ".task", path.tasks);
      }
      mission.paths.push_back(std::move(path));
    }
  }

  void readWaypoints(
      const YAML::Node& node, const std::string& where, double tolerance_m, Path& path) {
    const YAML::Node waypoints = find(node, "waypoints");
    if (!waypoints.IsDefined()) {
      problem(node, where + ".waypoints", "missing (required): a path needs a waypoint");
    } else if (!waypoints.IsMap()) {
      problem(waypoints, where + ".waypoints", "must be a mapping of names to positions");
    } else if (waypoints.size() == 0) {
      problem(waypoints, where + ".waypoints", "is empty: a path needs a waypoint");
    } else {
      std::set<std::string> names;
      for (const auto& entry : waypoints) {
        const std::string name = entry.first.IsScalar() ? entry.first.Scalar() : "(not a word)";
        const std::string key = where + ".waypoints." + name;
        if (!names.insert(name).second) {
          problem(entry.first, key, "given twice: waypoint names of a path must differ");
        }
        path.waypoints.push_back(readWaypoint(entry.second, key, tolerance_m));
        path.waypoints.back().name = name;
        path.waypoints.back().source.line = entry.first.Mark().line + 1;
      }
    }
  }

  Waypoint readWaypoint(const YAML::Node& node, const std::string& key, double tolerance_m) {
    Waypoint waypoint;
    waypoint.tolerance_m = tolerance_m;
    waypoint.source = {file_, node.Mark().is_null() ? 0 : node.Mark().line + 1};
    if (node.IsSequence()) {
      readGeodetic(node, key, waypoint);
    } else if (node.IsMap()) {
      readMetric(node, key, waypoint);
    } else {
      problem(
          node, key, "must be [lat_deg, lon_deg, alt_m, yaw_deg] or {x: .., y: .., yaw_deg: ..}");
    }
    return waypoint;
  }

  void readMetric(const YAML::Node& node, const std::string& key, Waypoint& waypoint) {
    checkKeys(node, key, {"x", "y", "yaw_deg", "tolerance_m", "yaw_tolerance_deg"});
    for (const auto& [name, value] :
         {std::pair{"x", &waypoint.T_map_base.x}, std::pair{"y", &waypoint.T_map_base.y}}) {
      const YAML::Node coordinate = find(node, name);
      if (!coordinate.IsDefined()) {
        problem(node, join(key, name), "missing (required)");
      } else {
        *value = number(coordinate, join(key, name), -kMaxFromDatum_m, kMaxFromDatum_m).value_or(0);
      }
    }
    if (const YAML::Node yaw = find(node, "yaw_deg"); yaw.IsDefined()) readYaw(yaw, key, waypoint);
    optionalNumber(node, key, "tolerance_m", waypoint.tolerance_m, 0.1, 10.0);
    double yaw_tolerance_deg = radToDeg(waypoint.yaw_tolerance_rad);
    optionalNumber(node, key, "yaw_tolerance_deg", yaw_tolerance_deg, 1.0, 180.0);
    waypoint.yaw_tolerance_rad = degToRad(yaw_tolerance_deg);
  }

  void readYaw(const YAML::Node& node, const std::string& key, Waypoint& waypoint) {
    if (const auto yaw_deg = number(node, join(key, "yaw_deg"), -360.0, 360.0)) {
      waypoint.T_map_base.phi = wrapToPi(degToRad(*yaw_deg));
      waypoint.has_yaw = true;
    }
  }

  void readGeodetic(const YAML::Node& node, const std::string& key, Waypoint& waypoint) {
    waypoint.geodetic = true;
    if (node.size() < 3 || node.size() > 4) {
      problem(
          node,
          key,
          "must be [lat_deg, lon_deg, alt_m, yaw_deg] (yaw optional), has " +
              std::to_string(node.size()) + " numbers");
      return;
    }
    // Latitude gets the wide interval first, so that swapped values are recognised as such.
    const auto lat = number(node[0], key + "[0] (latitude)", -360.0, 360.0);
    const auto lon = number(node[1], key + "[1] (longitude)", -360.0, 360.0);
    const auto alt = number(node[2], key + "[2] (altitude)", -kMaxAltitude_m, kMaxAltitude_m);
    if (node.size() == 4) readYaw(node[3], key, waypoint);
    if (!lat || !lon || !alt) return;

    const Geodetic position{*lat, *lon, *alt};
    const bool valid = isOnEarth(position);
    const double distance_m = valid ? fromDatum(position) : kMaxFromDatum_m * 2.0;
    const Geodetic swapped{*lon, *lat, *alt};
    if (distance_m > kMaxFromDatum_m && isOnEarth(swapped) &&
        fromDatum(swapped) <= kMaxFromDatum_m) {
      problem(
          node,
          key,
          format(
              "latitude and longitude look swapped: did you mean [%.9g, %.9g, ...]?", *lon, *lat));
    } else if (std::abs(*lat) > 90.0) {
      problem(node, key, format("latitude %.9g deg is out of range [-90, 90]", *lat));
    } else if (std::abs(*lon) > 180.0) {
      problem(node, key, format("longitude %.9g deg is out of range [-180, 180]", *lon));
    } else if (distance_m > kMaxFromDatum_m) {
      problem(
          node,
          key,
          format(
              "is %.1f km from the site's datum (%.6f, %.6f), at most 5 km are allowed",
              distance_m / 1000.0,
              site_.datum.lat_deg,
              site_.datum.lon_deg));
    } else {
      const Eigen::Vector3d enu = plane_.toEnu({*lat, *lon, site_.datum.height_m});
      waypoint.T_map_base.x = enu.x();
      waypoint.T_map_base.y = enu.y();
      checkOutdoorArea(node, key, {enu.x(), enu.y()});
    }
  }

  void checkOutdoorArea(const YAML::Node& node, const std::string& key, const Point2& p_map) {
    if (site_.outdoor_area.empty()) return;
    const double outside_m = geo::signedDistance(site_.outdoor_area, p_map);
    if (outside_m <= 0.0) return;
    problem(
        node,
        key,
        format(
            "at (%.2f, %.2f) m is %.2f m outside the site's outdoor area",
            p_map.x,
            p_map.y,
            outside_m));
  }

  static bool isOnEarth(const Geodetic& g) {
    return std::abs(g.lat_deg) <= 90.0 && std::abs(g.lon_deg) <= 180.0;
  }

  [[nodiscard]] double fromDatum(const Geodetic& g) const {
    const Eigen::Vector3d enu = plane_.toEnu({g.lat_deg, g.lon_deg, site_.datum.height_m});
    return enu.norm();
  }

  void readTasks(const YAML::Node& node, const std::string& where, std::vector<Task>& tasks) {
    if (!node.IsSequence()) {
      readTask(node, where, tasks);
      return;
    }
    for (std::size_t i = 0; i < node.size(); ++i) {
      readTask(node[i], where + "[" + std::to_string(i) + "]", tasks);
    }
  }

  void readTask(const YAML::Node& node, const std::string& where, std::vector<Task>& tasks) {
    Task task;
    task.source = {file_, node.Mark().is_null() ? 0 : node.Mark().line + 1};
    std::optional<std::string> type;
    if (node.IsScalar()) {
      type = node.Scalar();
    } else if (node.IsMap()) {
      type = text(node, where, "type", true);
    } else {
      problem(node, where, "must be a word or a mapping with a type");
    }
    if (!type) return;
    if (!taskType(*type, task.type)) {
      problem(
          node,
          where,
          "unknown task '" + *type + "': must be one of wait, input, photo, switch_localization");
      return;
    }
    if (node.IsMap()) {
      readTaskFields(node, where, task);
    } else if (task.type == TaskType::kSwitchLocalization) {
      problem(node, where, "needs a mode: {type: switch_localization, mode: indoor}");
    }
    tasks.push_back(std::move(task));
  }

  static bool taskType(const std::string& word, TaskType& type) {
    for (const TaskType candidate :
         {TaskType::kWait, TaskType::kInput, TaskType::kPhoto, TaskType::kSwitchLocalization}) {
      if (word == toString(candidate)) {
        type = candidate;
        return true;
      }
    }
    return false;
  }

  void readTaskFields(const YAML::Node& node, const std::string& where, Task& task) {
    switch (task.type) {
      case TaskType::kWait:
        checkKeys(node, where, {"type", "duration_s"});
        optionalNumber(node, where, "duration_s", task.duration_s, 0.0, 86400.0);
        break;
      case TaskType::kInput:
        checkKeys(node, where, {"type", "prompt", "default", "timeout_s"});
        task.prompt = text(node, where, "prompt", false).value_or("");
        task.default_answer = text(node, where, "default", false);
        optionalNumber(node, where, "timeout_s", task.timeout_s, 0.0, 86400.0);
        break;
      case TaskType::kPhoto:
        checkKeys(node, where, {"type", "file"});
        task.file = text(node, where, "file", false).value_or("");
        if (std::filesystem::path(task.file).has_parent_path()) {
          problem(find(node, "file"), where + ".file", "must be a file name without folders");
        }
        break;
      case TaskType::kSwitchLocalization: {
        checkKeys(node, where, {"type", "mode", "timeout_s"});
        optionalNumber(node, where, "timeout_s", task.timeout_s, 0.0, 86400.0);
        const auto mode = text(node, where, "mode", true);
        if (!mode) break;
        bool known = false;
        for (const LocalizationMode candidate :
             {LocalizationMode::kAuto, LocalizationMode::kOutdoor, LocalizationMode::kIndoor}) {
          if (*mode != toString(candidate)) continue;
          task.mode = candidate;
          known = true;
        }
        if (!known) {
          problem(
              find(node, "mode"),
              where + ".mode",
              "must be one of indoor, outdoor, auto, is '" + *mode + "'");
        }
        break;
      }
    }
  }

  std::string file_;
  const geo::Site& site_;
  geo::TangentPlane plane_;
  std::vector<std::pair<int, std::string>> problems_;
};

YAML::Node loadYaml(const std::string& path) {
  if (!std::filesystem::is_regular_file(path)) {
    throw ConfigError(path + ": no such mission file");
  }
  try {
    return YAML::LoadFile(path);
  } catch (const YAML::Exception& e) {
    throw ConfigError(path + ":" + std::to_string(e.mark.line + 1) + ": not valid YAML: " + e.msg);
  }
}

}  // namespace

std::string_view toString(TaskType type) {
  switch (type) {
    case TaskType::kWait:
      return "wait";
    case TaskType::kInput:
      return "input";
    case TaskType::kPhoto:
      return "photo";
    case TaskType::kSwitchLocalization:
      break;
  }
  return "switch_localization";
}

std::string_view toString(LocalizationMode mode) {
  switch (mode) {
    case LocalizationMode::kOutdoor:
      return "outdoor";
    case LocalizationMode::kIndoor:
      return "indoor";
    case LocalizationMode::kAuto:
      break;
  }
  return "auto";
}

Mission loadMission(const std::string& path, const geo::Site& site) {
  return MissionReader(path, site).read(loadYaml(path));
}

Mission loadMission(const std::string& path) {
  const YAML::Node root = loadYaml(path);
  const YAML::Node site = root.IsMap() ? root["site"] : YAML::Node(YAML::NodeType::Undefined);
  if (!site.IsDefined() || !site.IsScalar()) {
    throw ConfigError(path + ":1: site: missing (required): the path of the site file");
  }
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  const geo::Site loaded = geo::loadSite((folder / site.Scalar()).lexically_normal().string());
  return MissionReader(path, loaded).read(root);
}

Mission parseMission(const std::string& yaml, const std::string& name, const geo::Site& site) {
  try {
    return MissionReader(name, site).read(YAML::Load(yaml));
  } catch (const YAML::Exception& e) {
    throw ConfigError(name + ":" + std::to_string(e.mark.line + 1) + ": not valid YAML: " + e.msg);
  }
}

std::vector<std::string> checkAgainstMap(
    const Mission& mission, const grid::OccupancyMap& map, double robot_radius_m) {
  std::vector<std::string> messages;
  const grid::DistanceField field(map);
  for (const Path& path : mission.paths) {
    for (const Waypoint& waypoint : path.waypoints) {
      const Point2 p_map{waypoint.T_map_base.x, waypoint.T_map_base.y};
      const double clearance_m = field.at(p_map, 2.0 * robot_radius_m + 1.0);
      const std::string subject = waypoint.source.text() + ": waypoint '" + waypoint.name +
                                  "' of path '" + path.name + "' at " +
                                  format("(%.2f, %.2f) m ", p_map.x, p_map.y);
      if (map.at(p_map) == grid::Cell::kOccupied) {
        messages.push_back(subject + "is inside a mapped obstacle; move it into free space");
      } else if (clearance_m < robot_radius_m) {
        messages.push_back(
            subject + format(
                          "has %.2f m to the nearest mapped obstacle, the robot needs %.2f m; move "
                          "it by %.2f m",
                          clearance_m,
                          robot_radius_m,
                          robot_radius_m - clearance_m));
      }
    }
  }
  return messages;
}

}  // namespace vestibule::nav
