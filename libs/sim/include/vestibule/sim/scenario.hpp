#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/sim/route_follower.hpp"
#include "vestibule/sim/simulator.hpp"
#include "vestibule/sim/world.hpp"

namespace vestibule::sim {

/// Something that goes wrong at a stated time; exactly one of the kinds is set.
struct Incident {
  double at_s = 0.0;                             ///< after the start
  double for_s = 0.0;                            ///< how long, where the kind lasts
  std::optional<Eigen::Vector2d> slip;           ///< share of the grip that is left, left and right
  std::optional<Pose2> kidnap_to;                ///< carried there, wheels standing
  std::optional<double> gyro_bias_step_radps;    ///< about the vertical axis
  std::optional<Eigen::Vector3d> gnss_offset_m;  ///< every fix is off by this, ENU
  bool grows = false;                            ///< gnss_offset_m grows from nothing over `for_s`
  bool gnss_blocked = false;                     ///< no satellite is received: fixes of type none
  bool reboot = false;                           ///< the computer is off: nothing is recorded
};
void describe(ParamIo& io, Incident& incident);

/// A drive in a world with stated faults: what a filter, a localizer or the whole program is tried
/// on. File format: docs/worlds.md.
struct Scenario {
  std::string name;
  std::string set;  ///< "filter", "map" or "door": METHODS-style check lists of the three parts
  std::string world_path;
  std::optional<std::string> site_path;
  std::optional<std::string> sim_path;
  World world;
  SimParams sim;  ///< of sim_path, changed by the scenario's own `params`
  Pose2 T_map_base_start;
  std::vector<Leg> drive;
  int repeat = 1;                    ///< the whole drive this often
  std::optional<double> duration_s;  ///< stops here at the latest; needed where nothing is driven
  std::vector<Incident> incidents;
  /// What is wrong in what the estimators are told, for those that use it.
  Pose2 georeference_error;              ///< true T_map_grid = the site's composed with this
  std::optional<Pose2> T_map_base_told;  ///< start pose told; empty = the true one
  bool told_nothing = false;             ///< the start is unknown
};

/// \param name_or_path  "open_sky" (looked up as <folder>/open_sky.yaml) or a path to a YAML file
/// Throws ConfigError with file:line of every problem; an unknown name lists the known ones.
[[nodiscard]] Scenario loadScenario(const std::string& name_or_path, const std::string& folder);

/// The scenario's site as the estimators are told it: with the georeference error in the poses of
/// its indoor maps. Empty when the scenario has no site; throws ConfigError for a bad site file.
[[nodiscard]] std::optional<geo::Site> siteAsTold(const Scenario& scenario);

/// The start pose the estimators are told; empty when it is unknown to them.
[[nodiscard]] std::optional<Pose2> startAsTold(const Scenario& scenario);

/// A scenario as one YAML text, its robot's parameters written out.
[[nodiscard]] std::string dumpScenario(const Scenario& scenario);

/// Names of the scenarios in a folder, sorted.
[[nodiscard]] std::vector<std::string> scenarioNames(const std::string& folder);

/// A scenario being driven. Same scenario and seed give the same bytes; runs share nothing and may
/// go on in different threads.
class ScenarioRun {
 public:
  ScenarioRun(const Scenario& scenario, std::uint64_t seed);

  /// Drives on for `dt`. \pre !finished(); dt as for Simulator::step
  [[nodiscard]] std::vector<Delivered> step(Duration dt);
  /// Driven, out of time or run into something.
  [[nodiscard]] bool finished() const;
  /// Whether the computer is switched off at that time.
  [[nodiscard]] bool offAt(Timestamp stamp) const;
  [[nodiscard]] Simulator& simulator() { return simulator_; }
  [[nodiscard]] const Simulator& simulator() const { return simulator_; }
  [[nodiscard]] double elapsed() const;   ///< [s]
  [[nodiscard]] double progress() const;  ///< [0, 1]

 private:
  void handleIncidents();

  const Scenario& scenario_;
  Simulator simulator_;
  RouteFollower follower_;
  std::vector<bool> begun_;
};

}  // namespace vestibule::sim
