#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "run_output.hpp"
#include "runs.hpp"
#include "terminal.hpp"
#include "vestibule/io/rawlog_writer.hpp"
#include "vestibule/sim/world_geometry.hpp"

namespace vestibule::app {
namespace {

Json toJson(const pipeline::ErrorFigures& f) {
  Json json;
  json["count"] = f.count;
  json["rmse_m"] = rounded(f.rmse_m, 6);
  json["max_m"] = rounded(f.max_m, 6);
  json["max_yaw_deg"] = rounded(radToDeg(f.max_yaw_rad), 6);
  return json;
}

void fillSummary(Json& s, const MissionArguments& args, const pipeline::MissionResult& result) {
  s["mission"] = args.mission;
  s["world"] = args.world;
  s["done"] = result.done;
  s["abort_reason"] = result.abort_reason;
  s["waypoints_in_order"] = result.in_order;
  s["collided"] = result.collided;
  s["min_clearance_m"] = rounded(result.min_clearance_m, 4);
  s["duration_s"] = rounded(result.duration_s, 3);
  s["distance_m"] = rounded(result.distance_m, 3);
  s["mode_switches"] = result.mode_switches;
  s["maps_loaded"] = result.map_changes.loaded;
  s["maps_unloaded"] = result.map_changes.unloaded;
  s["recoveries"] = result.recoveries;
  s["correction_step_100ms"]["position_m"] = rounded(result.correction.position_m, 6);
  s["correction_step_100ms"]["yaw_deg"] = rounded(radToDeg(result.correction.yaw_rad), 6);
  s["error"] = toJson(result.error);
  s["door_zone_error"] = toJson(result.door_zone);
  for (const pipeline::WaypointResult& w : result.waypoints) {
    Json waypoint;
    waypoint["path"] = w.path;
    waypoint["name"] = w.name;
    waypoint["reached"] = w.reached;
    if (w.reached) waypoint["stamp"] = formatSeconds(w.stamp);
    if (w.reached) waypoint["true_miss_m"] = rounded(w.true_miss_m, 4);
    s["waypoints"].push_back(waypoint);
  }
}

std::vector<gui_headless::Figure> figuresOf(const pipeline::MissionResult& result) {
  std::size_t reached = 0;
  for (const auto& w : result.waypoints) reached += w.reached ? 1U : 0U;
  using Verdict = gui_headless::Figure::Verdict;
  auto waypoints = figure(
      "waypoints reached in order",
      std::to_string(reached) + " of " + std::to_string(result.waypoints.size()));
  waypoints.verdict = result.in_order ? Verdict::kGood : Verdict::kBad;
  waypoints.bar = "all";
  auto collision = figure("collisions in the true world", result.collided ? "1" : "0");
  collision.verdict = result.collided ? Verdict::kBad : Verdict::kGood;
  collision.bar = "0";
  return {
      waypoints,
      collision,
      figureAtMost("largest pose step per 100 ms", result.correction.position_m, 3, "m", 0.05),
      figureAtMost(
          "largest yaw step per 100 ms", radToDeg(result.correction.yaw_rad), 3, "deg", 0.5),
      figure(
          "position error within 10 m of a door, largest", fixed(result.door_zone.max_m, 3), "m"),
      figure("position error, whole run, RMSE", fixed(result.error.rmse_m, 3), "m"),
      figure("smallest clearance", fixed(result.min_clearance_m, 2), "m"),
      figure("changes of authority", std::to_string(result.mode_switches)),
      figure("recoveries", std::to_string(result.recoveries)),
      figure("driven", fixed(result.distance_m, 1), "m"),
      figure("duration", fixed(result.duration_s, 0), "s")};
}

}  // namespace

pipeline::Config missionConfig(const MissionArguments& args) {
  pipeline::Config config = pipeline::loadConfig(args.config);
  config.seed = args.seed;
  return config;
}

gui_headless::ReportSection runMissionCommand(
    const MissionArguments& args, RunOutput& output, pipeline::MissionResult& result) {
  const pipeline::Config config = missionConfig(args);
  const auto setup = pipeline::loadMissionSetup(args.mission, args.world, config);
  for (const std::string& note : setup.map_notes) std::fprintf(stderr, "%s\n", note.c_str());
  const sim::WorldGeometry geometry(setup.world);

  gui_headless::Scene scene;
  scene.site = &setup.site;
  for (const sim::Segment& s : geometry.segments()) scene.truth_walls.emplace_back(s.a, s.b);
  for (const nav::Path& path : setup.mission.paths) {
    for (const nav::Waypoint& w : path.waypoints)
      scene.waypoints.emplace_back(w.name, w.T_map_base);
  }

  std::vector<gui_headless::Picture> photos;
  pipeline::MissionHooks hooks;
  hooks.photo = [&](const pipeline::PhotoRequest& request) {
    gui_headless::PhotoView view;
    view.T_map_base = request.T_map_base;
    view.p_base_scan = request.p_base_scan;
    view.stamp = request.stamp;
    view.waypoint = request.waypoint;
    view.robot_half_length_m = setup.sim.footprint.half_length_m;
    view.robot_half_width_m = setup.sim.footprint.half_width_m;
    gui_headless::Scene around = scene;
    for (const auto& map : request.maps) around.prior_maps.push_back(map.get());
    const std::string png = gui_headless::renderPhoto(view, around);
    output.picture(request.file, png);
    photos.push_back({"photo at " + request.waypoint, png});
  };
  std::unique_ptr<io::RawlogWriter> recording;
  if (args.record) {
    recording = std::make_unique<io::RawlogWriter>(output.stage("recording.rawlog"));
    hooks.measurement = [&](const Measurement& m) { recording->write(m, io::labelOf(m)); };
  }

  double wall_s = 0.0;
  {
    ProgressBar bar("mission");
    result = pipeline::runMission(setup, config, output.observers(), hooks, bar.callback());
    wall_s = bar.wallSeconds();
  }
  if (recording) recording->close();
  output.timing(wall_s, result.duration_s);
  output.trajectory(result.published);
  output.trajectory(result.odometry, "odometry.tum");
  output.trajectory(result.truth, "truth.tum");
  fillSummary(output.summary(), args, result);

  const auto maps = mapsForPictures(setup.site);
  for (const auto& map : maps) scene.prior_maps.push_back(map.get());
  auto section = gui_headless::sectionFromRun(output.recorder(), scene, args.title);
  section.figures = figuresOf(result);
  if (!section.pictures.empty()) output.picture("map.png", section.pictures.front().png);
  for (auto& photo : photos) section.pictures.push_back(std::move(photo));
  return section;
}

void addMission(CLI::App& app, int& exit_code) {
  struct Options {
    MissionArguments args;
    std::string out;
  };
  auto o = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "mission", "drives a mission in the simulator, in closed loop, through the door");
  command->add_option("MISSION", o->args.mission, "mission YAML")->required();
  command->add_option("--world", o->args.world, "world YAML: the true world")->required();
  command->add_option("--seed", o->args.seed, "seed of all randomness")->capture_default_str();
  command->add_option("--config", o->args.config, "YAML as config/default.yaml");
  command->add_flag(
      "--record", o->args.record, "also write recording.rawlog, what the sensors measured");
  command->add_option("--out", o->out, "output folder")->required();
  command->callback([o, &exit_code] {
    o->args.title = "Mission in the simulator";
    RunOutput output(o->out, "mission", missionConfig(o->args));
    pipeline::MissionResult result;
    gui_headless::Report report;
    report.title = "Vestibule: mission";
    report.subtitle = o->args.mission + " in " + o->args.world;
    report.sections.push_back(runMissionCommand(o->args, output, result));
    output.report(report);
    output.finish();

    std::vector<std::vector<std::string>> rows{{"figure", "value", "unit", "bar"}};
    for (const auto& f : report.sections.front().figures) {
      rows.push_back({f.label, f.value, f.unit, f.bar});
    }
    std::fputs(textTable(rows).c_str(), stdout);
    if (!result.done) std::printf("mission aborted: %s\n", result.abort_reason.c_str());
    std::printf("report: %s\n", output.pathOf("report.html").c_str());
    exit_code = result.done && result.in_order ? kDone : kFailedPurpose;
  });
}

}  // namespace vestibule::app
