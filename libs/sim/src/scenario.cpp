#include "vestibule/sim/scenario.hpp"

#include <algorithm>
#include <filesystem>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::sim {
namespace {

namespace fs = std::filesystem;

/// Control rate of the scripted drive.
constexpr Duration kControl = std::chrono::milliseconds(50);

template <int n>
void vectorField(ParamIo& io, const char* key, std::optional<Eigen::Matrix<double, n, 1>>& vector) {
  if (io.writing() ? !vector.has_value() : !io.has(key)) return;
  std::vector<double> values(n, 0.0);
  if (vector) values.assign(vector->data(), vector->data() + n);
  io.required(key, values, n, n);
  vector = Eigen::Map<const Eigen::Matrix<double, n, 1>>(values.data());
}

}  // namespace

void describe(ParamIo& io, Incident& incident) {
  io.required("at_s", incident.at_s, nonNegative());
  io.optional("for_s", incident.for_s, nonNegative());
  vectorField<2>(io, "slip", incident.slip);
  io.optional("kidnap_to", incident.kidnap_to);
  if (io.writing() ? incident.gyro_bias_step_radps.has_value() : io.has("gyro_bias_step_degps")) {
    double step_radps = incident.gyro_bias_step_radps.value_or(0.0);
    io.optionalDegrees("gyro_bias_step_degps", step_radps, within(-100.0, 100.0));
    incident.gyro_bias_step_radps = step_radps;
  }
  vectorField<3>(io, "gnss_offset_m", incident.gnss_offset_m);
  io.optional("grows", incident.grows);
  io.optional("gnss_blocked", incident.gnss_blocked);
  io.optional("reboot", incident.reboot);
  if (io.writing()) return;
  const int kinds = (incident.slip ? 1 : 0) + (incident.kidnap_to ? 1 : 0) +
                    (incident.gyro_bias_step_radps ? 1 : 0) + (incident.gnss_offset_m ? 1 : 0) +
                    (incident.gnss_blocked ? 1 : 0) + (incident.reboot ? 1 : 0);
  if (kinds != 1) {
    io.problem(
        "",
        "an incident has exactly one of slip, kidnap_to, gyro_bias_step_degps, gnss_offset_m, "
        "gnss_blocked, reboot");
  }
  const bool lasts =
      incident.slip || incident.gnss_offset_m || incident.gnss_blocked || incident.reboot;
  if (lasts && incident.for_s <= 0.0) io.problem("", "this incident needs for_s > 0");
}

namespace {

void describeScenario(ParamIo& io, Scenario& scenario, const fs::path& folder) {
  const auto resolved = [&](const std::string& path) {
    return (fs::path(path).is_absolute() ? fs::path(path) : folder / path)
        .lexically_normal()
        .string();
  };
  io.required("name", scenario.name);
  io.optional("set", scenario.set);
  if (scenario.set != "filter" && scenario.set != "map" && scenario.set != "door") {
    io.problem("set", "must be filter, map or door");
  }
  io.required("world", scenario.world_path);
  scenario.world_path = resolved(scenario.world_path);
  io.optional("site", scenario.site_path);
  if (scenario.site_path) scenario.site_path = resolved(*scenario.site_path);
  io.optional("sim", scenario.sim_path);
  if (scenario.sim_path) {
    scenario.sim_path = resolved(*scenario.sim_path);
    if (io.writing()) {
      // Its content is part of `params`.
    } else if (fs::is_regular_file(*scenario.sim_path)) {
      scenario.sim = loadParams<SimParams>(*scenario.sim_path);
    } else {
      io.problem("sim", *scenario.sim_path + ": no such file");
    }
  }
  io.section("params", scenario.sim);
  io.required("start", scenario.T_map_base_start);
  io.list("drive", scenario.drive);
  io.optional("repeat", scenario.repeat, within(1, 1000));
  io.optional("duration_s", scenario.duration_s, positive());
  if (scenario.drive.empty() && !scenario.duration_s) {
    io.problem("duration_s", "is needed where nothing is driven");
  }
  io.list("incidents", scenario.incidents);
  io.optional("georeference_error", scenario.georeference_error);
  io.optional("start_told", scenario.T_map_base_told);
  io.optional("start_unknown", scenario.told_nothing);
  if (scenario.site_path && !fs::is_regular_file(*scenario.site_path)) {
    io.problem("site", *scenario.site_path + ": no such file");
  }
}

}  // namespace

std::optional<geo::Site> siteAsTold(const Scenario& scenario) {
  if (!scenario.site_path) return std::nullopt;
  geo::Site site = geo::loadSite(*scenario.site_path);
  for (geo::IndoorMap& map : site.indoor_maps) {
    // true = told * error
    map.T_map_grid = compose(map.T_map_grid, inverse(scenario.georeference_error));
  }
  return site;
}

std::optional<Pose2> startAsTold(const Scenario& scenario) {
  if (scenario.told_nothing) return std::nullopt;
  return scenario.T_map_base_told.value_or(scenario.T_map_base_start);
}

std::string dumpScenario(const Scenario& scenario) {
  ParamFile file = ParamFile::forWriting();
  Scenario copy = scenario;
  describeScenario(file.io(), copy, {});
  return file.yaml();
}

std::vector<std::string> scenarioNames(const std::string& folder) {
  std::vector<std::string> names;
  if (!fs::is_directory(folder)) return names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".yaml") names.push_back(entry.path().stem().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

Scenario loadScenario(const std::string& name_or_path, const std::string& folder) {
  fs::path path = name_or_path;
  if (path.extension() != ".yaml") {
    path = fs::path(folder) / (name_or_path + ".yaml");
    if (!fs::is_regular_file(path)) {
      const auto names = scenarioNames(folder);
      std::string text = "scenario " + name_or_path + ": not known";
      if (const auto near = nearestWord(name_or_path, names)) {
        text += " (did you mean " + *near + "?)";
      }
      text += "; there are";
      for (const std::string& name : names) text += " " + name;
      throw ConfigError(text + "; or give a YAML file");
    }
  }
  Scenario scenario;
  ParamFile file = ParamFile::fromFile(path.string());
  describeScenario(file.io(), scenario, path.parent_path());
  file.finishReading();
  scenario.world = loadWorld(scenario.world_path);
  return scenario;
}

ScenarioRun::ScenarioRun(const Scenario& scenario, std::uint64_t seed)
    : scenario_(scenario),
      simulator_(scenario.world, scenario.sim, scenario.T_map_base_start, seed),
      follower_(
          [&] {
            std::vector<Leg> legs;
            for (int i = 0; i < scenario.repeat; ++i) {
              legs.insert(legs.end(), scenario.drive.begin(), scenario.drive.end());
            }
            return legs;
          }(),
          scenario.T_map_base_start,
          scenario.sim.robot.drive != DriveType::kAckermann),
      begun_(scenario.incidents.size(), false) {}

double ScenarioRun::elapsed() const { return toSeconds(simulator_.time() - kStartOfTime); }

double ScenarioRun::progress() const {
  const double by_time = scenario_.duration_s ? elapsed() / *scenario_.duration_s : 0.0;
  return std::min(1.0, std::max(by_time, follower_.progress()));
}

bool ScenarioRun::finished() const {
  if (simulator_.collided()) return true;
  if (scenario_.duration_s && elapsed() >= *scenario_.duration_s - 1e-9) return true;
  return !scenario_.drive.empty() && follower_.finished();
}

bool ScenarioRun::offAt(Timestamp stamp) const {
  const double now_s = toSeconds(stamp - kStartOfTime);
  return std::any_of(
      scenario_.incidents.begin(), scenario_.incidents.end(), [&](const Incident& incident) {
        return incident.reboot && now_s >= incident.at_s && now_s < incident.at_s + incident.for_s;
      });
}

void ScenarioRun::handleIncidents() {
  const double now_s = elapsed();
  Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();
  bool blocked = false;
  for (std::size_t i = 0; i < scenario_.incidents.size(); ++i) {
    const Incident& incident = scenario_.incidents[i];
    if (now_s < incident.at_s) continue;
    if (now_s < incident.at_s + incident.for_s) {
      const double share = incident.grows ? (now_s - incident.at_s) / incident.for_s : 1.0;
      if (incident.gnss_offset_m) offset_m += share * *incident.gnss_offset_m;
      blocked = blocked || incident.gnss_blocked;
    }
    if (begun_[i]) continue;
    begun_[i] = true;
    if (incident.slip) {
      simulator_.forceSlip(
          incident.slip->x(), incident.slip->y(), durationFromSeconds(incident.for_s));
    }
    if (incident.kidnap_to) simulator_.carryTo(*incident.kidnap_to);
    if (incident.gyro_bias_step_radps) simulator_.stepGyroBias(*incident.gyro_bias_step_radps);
  }
  simulator_.disturbGnss(offset_m, blocked);
}

std::vector<Delivered> ScenarioRun::step(Duration dt) {
  std::vector<Delivered> all;
  for (Duration done{0}; done < dt && !finished();) {
    const Duration part = std::min(dt - done, kControl);
    handleIncidents();
    const VelocityCommand command = follower_.step(simulator_.truth(), part);
    simulator_.command(command.v_mps, command.omega_radps);
    for (Delivered& delivered : simulator_.step(part)) {
      if (!offAt(delivered.arrival)) all.push_back(std::move(delivered));
    }
    done += part;
  }
  return all;
}

}  // namespace vestibule::sim
