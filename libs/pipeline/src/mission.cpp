#include "vestibule/pipeline/mission.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "vestibule/core/errors.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/mrpt_adapters/reactive_driver.hpp"
#include "vestibule/pipeline/seamless_estimator.hpp"

namespace vestibule::pipeline {
namespace {

constexpr Duration kTick = std::chrono::milliseconds(20);
constexpr int kTicksPerControl = 5;  // 10 Hz
constexpr double kMaxMission_s = 3600.0;
constexpr double kDoorZone_m = 10.0;

std::optional<Mode> modeOf(nav::LocalizationMode mode) {
  switch (mode) {
    case nav::LocalizationMode::kIndoor:
      return Mode::kIndoor;
    case nav::LocalizationMode::kOutdoor:
      return Mode::kOutdoor;
    case nav::LocalizationMode::kAuto:
      break;
  }
  return std::nullopt;
}

/// Answers the mission's tasks.
class Host : public nav::MissionHost {
 public:
  Host(SeamlessEstimator& estimator, const MissionHooks& hooks)
      : estimator_(estimator), hooks_(hooks) {}

  void takePhoto(Timestamp stamp, const nav::Path& path, const nav::Task& task) override {
    if (!hooks_.photo) return;
    PhotoRequest request;
    request.stamp = stamp;
    request.waypoint = path.waypoints.back().name;
    request.file = task.file.empty() ? request.waypoint + ".png" : task.file;
    request.T_map_base = estimator_.modeManager().published().mean;
    request.p_base_scan = scan_base;
    request.maps = estimator_.maps();
    hooks_.photo(request);
  }
  void requestLocalization(nav::LocalizationMode mode) override {
    estimator_.modeManager().force(modeOf(mode));
  }
  bool localizationReached(nav::LocalizationMode mode) override {
    const auto wanted = modeOf(mode);
    return !wanted || estimator_.modeManager().mode() == *wanted;
  }
  std::optional<std::string> operatorAnswer(const nav::Task& /*task*/) override {
    return std::nullopt;
  }

  std::vector<Point2> scan_base;  ///< newest scan, for photos and driving
  std::optional<Timestamp> scan_stamp;

 private:
  SeamlessEstimator& estimator_;
  const MissionHooks& hooks_;
};

/// Follows the mission's progress and the published error against the truth.
class Judge : public Observer {
 public:
  Judge(const MissionSetup& setup, const sim::Simulator& simulator, MissionResult& result)
      : site_(setup.site), simulator_(simulator), result_(result) {
    for (const nav::Path& path : setup.mission.paths) {
      for (const nav::Waypoint& waypoint : path.waypoints) {
        WaypointResult w;
        w.path = path.name;
        w.name = waypoint.name;
        result_.waypoints.push_back(w);
        poses_.push_back(waypoint.T_map_base);
      }
    }
  }

  void onMission(const MissionEvent& event) override {
    if (event.kind != MissionEvent::Kind::kWaypointReached) return;
    // The next one in order, or none: a waypoint that was skipped stays unreached.
    if (next_ >= result_.waypoints.size() || result_.waypoints[next_].name != event.waypoint) {
      out_of_order = true;
      return;
    }
    WaypointResult& w = result_.waypoints[next_];
    w.reached = true;
    w.stamp = event.stamp;
    w.true_miss_m = distance(simulator_.truth(), poses_[next_]);
    ++next_;
  }
  void onMode(const ModeEvent& event) override {
    if (event.from != event.to) ++result_.mode_switches;
  }
  void onMap(const MapEvent& event) override { result_.map_changes.count(event); }

  void compare(Timestamp stamp, const Pose2& published, const Pose2& T_odom_base) {
    const Pose2& truth = simulator_.truth();
    result_.published.push_back({stamp, published});
    result_.odometry.push_back({stamp, T_odom_base});
    result_.truth.push_back({stamp, truth});
    const double error_m = distance(published, truth);
    const double yaw_rad = std::abs(angleDiff(published.phi, truth.phi));
    add(result_.error, error_m, yaw_rad);
    for (const geo::Door& door : site_.doors) {
      if (geo::distanceToSegment({truth.x, truth.y}, door.a, door.b) <= kDoorZone_m) {
        add(result_.door_zone, error_m, yaw_rad);
        break;
      }
    }
  }

  void finish() {
    for (ErrorFigures* f : {&result_.error, &result_.door_zone}) {
      if (f->count > 0) f->rmse_m = std::sqrt(f->rmse_m / static_cast<double>(f->count));
    }
    result_.in_order = !out_of_order && next_ == result_.waypoints.size();
  }

  bool out_of_order = false;

 private:
  static void add(ErrorFigures& f, double error_m, double yaw_rad) {
    ++f.count;
    f.rmse_m += error_m * error_m;  // sum of squares until finish()
    f.max_m = std::max(f.max_m, error_m);
    f.max_yaw_rad = std::max(f.max_yaw_rad, yaw_rad);
  }

  const geo::Site& site_;
  const sim::Simulator& simulator_;
  MissionResult& result_;
  std::vector<Pose2> poses_;
  std::size_t next_ = 0;
};

}  // namespace

MissionSetup loadMissionSetup(
    const std::string& mission_path, const std::string& world_path, const Config& config) {
  MissionSetup setup;
  setup.mission = nav::loadMission(mission_path);
  setup.site = geo::loadSite(setup.mission.site_path);
  setup.world = sim::loadWorld(world_path);
  if (setup.mission.sim_path) setup.sim = loadParams<sim::SimParams>(*setup.mission.sim_path);

  std::string problems;
  const auto report = [&problems](const std::string& text) {
    problems += (problems.empty() ? "" : "\n") + text;
  };
  constexpr double kSameSite_m = 5000.0;
  const double apart_m =
      geo::TangentPlane(setup.site.datum).toEnu(setup.world.datum).head<2>().norm();
  if (apart_m > kSameSite_m) {
    report(
        world_path + ": datum: the world lies " + std::to_string(std::lround(apart_m / 1000.0)) +
        " km from the site " + setup.site.file + " of the mission; use a world of that site");
  }
  const auto checkAgainst = [&](const grid::OccupancyMap& map) {
    for (const std::string& text :
         nav::checkAgainstMap(setup.mission, map, config.mission.footprint.half_width_m)) {
      report(text);
    }
  };
  setup.map_rectangles = surveyIndoorMaps(setup.site, &setup.map_notes, checkAgainst);
  if (!problems.empty()) throw ConfigError(problems);
  return setup;
}

MissionResult runMission(
    const MissionSetup& setup,
    const Config& config,
    const Observers& observers,
    const MissionHooks& hooks,
    const Progress& progress) {
  MissionResult result;
  sim::Simulator simulator(setup.world, setup.sim, setup.mission.T_map_base_start, config.seed);
  Judge judge(setup, simulator, result);
  Observers all = observers;
  all.attach(judge);

  // The robot knows its own sensors: the rig comes with it.
  Config robot_config = config;
  robot_config.rig = setup.sim.rig;
  SeamlessEstimator estimator(robot_config, setup.site, setup.map_rectangles, all);
  estimator.start(simulator.time(), toldStart(setup.mission.T_map_base_start));

  mrpt_adapters::ReactiveDriver driver(config.driver);
  Host host(estimator, hooks);
  nav::MissionRunner runner(setup.mission, config.mission, driver, host, all);

  const Timestamp begin = simulator.time();
  Timestamp last_compared = begin;
  int ticks = 0;
  while (!runner.finished() && !simulator.collided()) {
    for (const sim::Delivered& delivered : simulator.step(kTick)) {
      const Measurement& measurement = delivered.measurement;
      if (hooks.measurement) hooks.measurement(measurement);
      if (const auto* scan = std::get_if<LaserScan>(&measurement)) {
        host.scan_base = endPointsInBase(*scan);
        host.scan_stamp = scan->stamp;
      }
      estimator.process(measurement);
    }
    if (estimator.ready() && estimator.time() > last_compared) {
      last_compared = estimator.time();
      judge.compare(
          last_compared, estimator.modeManager().published().mean, estimator.T_odom_base());
      PoseEvent truth;
      truth.stamp = simulator.time();
      truth.source = PoseSource::kTruth;
      truth.T.mean = simulator.truth();
      all.emit(truth);
    }
    if (++ticks % kTicksPerControl != 0) continue;

    nav::RunnerInput input;
    input.stamp = simulator.time();
    if (estimator.ready()) {
      input.T_map_base = estimator.modeManager().published().mean;
      if (estimator.modeManager().mode() != Mode::kLost) input.pose_stamp = estimator.time();
    }
    input.T_odom_base = estimator.T_odom_base();
    input.v_mps = estimator.speed();
    input.omega_radps = estimator.yawRate();
    if (host.scan_stamp) input.scan_base = &host.scan_base;
    input.p_base_laser = {setup.sim.rig.T_base_laser.x, setup.sim.rig.T_base_laser.y};
    input.scan_stamp = host.scan_stamp;
    const nav::RunnerOutput output = runner.step(input);
    simulator.command(output.command.v_mps, output.command.omega_radps);

    const double elapsed_s = toSeconds(simulator.time() - begin);
    progress(
        static_cast<double>(runner.waypointsReached()) /
            static_cast<double>(std::max<std::size_t>(1, runner.waypointsTotal())),
        elapsed_s);
    if (elapsed_s > kMaxMission_s) {
      result.abort_reason = "not finished after an hour of simulated time";
      break;
    }
  }

  judge.finish();
  result.collided = simulator.collided();
  result.done = runner.state() == nav::RunnerState::kDone && !result.collided;
  if (result.collided) result.abort_reason = "the robot ran into something";
  if (!result.done && result.abort_reason.empty()) result.abort_reason = runner.abortReason();
  result.min_clearance_m = simulator.minClearance();
  result.duration_s = toSeconds(simulator.time() - begin);
  result.distance_m = simulator.distanceDriven();
  result.recoveries = runner.recoveries();
  result.correction = metrics::largestCorrection(result.published, result.odometry);
  return result;
}

}  // namespace vestibule::pipeline
