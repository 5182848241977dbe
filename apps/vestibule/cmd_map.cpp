#include <cstdio>
#include <filesystem>
#include <memory>

#include "commands.hpp"
#include "run_output.hpp"
#include "runs.hpp"
#include "terminal.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/memory.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/io/simple_map.hpp"
#include "vestibule/pipeline/map.hpp"

namespace vestibule::app {
namespace {

void mapKnownPoses(const MapArguments& args) {
  const pipeline::Config config = pipeline::loadConfig(args.config);
  io::RecordingOptions options;
  options.rig = config.rig;
  options.csv_mapping_dir = shipped("config/csv");
  RunOutput output(args.out, "map", config);
  double wall_s = 0.0;
  const pipeline::MapResult result = [&] {
    ProgressBar bar("map");
    auto r =
        pipeline::mapFromKnownPoses(args.log, options, config, output.observers(), bar.callback());
    wall_s = bar.wallSeconds();
    return r;
  }();
  io::saveMapServer(result.map, output.stage("map.yaml"), output.stage("map.pgm"), "map.pgm");
  output.trajectory(result.trajectory);

  const auto cells = static_cast<double>(result.map.width()) * result.map.height();
  const auto share = [&](grid::Cell kind) {
    return static_cast<double>(result.map.count(kind)) / cells;
  };
  Json& s = output.summary();
  s["input"] = args.log;
  s["scans"] = result.trajectory.size();
  s["distance_m"] = rounded(result.distance_m, 4);
  s["resolution_m"] = result.map.resolution();
  s["width_cells"] = result.map.width();
  s["height_cells"] = result.map.height();
  s["free_share"] = rounded(share(grid::Cell::kFree), 6);
  s["occupied_share"] = rounded(share(grid::Cell::kOccupied), 6);
  s["unknown_share"] = rounded(share(grid::Cell::kUnknown), 6);
  s["notes"] = result.notes;

  gui_headless::Scene scene;
  scene.prior_maps = {&result.map};
  auto section = gui_headless::sectionFromRun(output.recorder(), scene, "Map from known poses");
  section.figures = {
      figure("scans", std::to_string(result.trajectory.size())),
      figure("path", fixed(result.distance_m, 1), "m"),
      figure(
          "size",
          fixed(result.map.width() * result.map.resolution(), 1) + " x " +
              fixed(result.map.height() * result.map.resolution(), 1),
          "m"),
      figure("cell", fixed(100.0 * result.map.resolution(), 1), "cm"),
      figure("occupied", fixed(100.0 * share(grid::Cell::kOccupied), 2), "%"),
      figure("free", fixed(100.0 * share(grid::Cell::kFree), 1), "%")};
  if (!section.pictures.empty()) output.picture("map.png", section.pictures.front().png);
  gui_headless::Report report;
  report.title = "Vestibule: map";
  report.subtitle = args.log;
  report.sections.push_back(std::move(section));
  output.report(report);
  const double span_s = toSeconds(result.trajectory.back().stamp - result.trajectory.front().stamp);
  output.timing(wall_s, span_s);
  output.finish();
  std::printf(
      "%zu scans, map of %d x %d cells of %.0f cm\nmap: %s\nreport: %s\n",
      result.trajectory.size(),
      result.map.width(),
      result.map.height(),
      100.0 * result.map.resolution(),
      output.pathOf("map.yaml").c_str(),
      output.pathOf("report.html").c_str());
}

void printMap(const grid::OccupancyMap& map, const RunOutput& output) {
  std::printf(
      "map of %d x %d cells of %.0f cm: %s\nreport: %s\n",
      map.width(),
      map.height(),
      100.0 * map.resolution(),
      output.pathOf("map.yaml").c_str(),
      output.pathOf("report.html").c_str());
}

void removeJournal(const RunOutput& output) {
  std::error_code error;
  std::filesystem::remove(output.pathOf(kJournal), error);
}

/// Exit code.
int mapDrive(const MapArguments& args) {
  const pipeline::Config config = mapConfig(args);
  RunOutput output(args.out, "map", config);
  auto [result, section] = [&] {
    try {
      return runMap(args, config, output);
    } catch (const Interrupted&) {
      throw Interrupted("interrupted; the same command with --resume goes on from here");
    } catch (const std::exception&) {
      removeJournal(output);  // it would end there again
      throw;
    }
  }();
  gui_headless::Report report;
  report.title = "Vestibule: map";
  report.subtitle = args.log;
  report.sections.push_back(std::move(section));
  output.report(report);
  output.finish();
  removeJournal(output);
  std::printf(
      "%zu scans, %.1f m in %.1f s; %zu scans used by %d particles; held-out scans: %.1f %% of the "
      "beams on walls\n",
      result.trajectory.size(),
      result.distance_m,
      result.data_s,
      result.updates.size(),
      config.mapping.filter.particles,
      100.0 * result.quality.held_out_matched_share);
  printMap(result.map, output);
  if (!result.damage) return kDone;
  std::fprintf(
      stderr,
      "vestibule: %s\nvestibule: the map is of the %zu scans before it\n",
      result.damage->c_str(),
      result.trajectory.size());
  return kBadInput;
}

/// The map of an earlier run without one of its sessions.
void mapWithoutSession(const MapArguments& args) {
  const pipeline::Config config = mapConfig(args);
  RunOutput output(args.out, "map", config);
  const std::vector<io::MapFrame> frames = earlierFrames(args);
  const auto [map, sessions] = pipeline::mapOfFrames(frames, config);
  io::saveMapServer(map, output.stage("map.yaml"), output.stage("map.pgm"), "map.pgm");
  io::saveSimpleMap(output.stage("map.simplemap"), frames);
  saveSessions(sessions, map, output);
  metrics::Trajectory trajectory;
  for (const io::MapFrame& f : frames) trajectory.push_back({f.scan.stamp, f.T_map_base});
  output.trajectory(trajectory);
  Json& s = output.summary();
  s["input"] = args.extend;
  s["cut_session"] = *args.cut;
  s["scans"] = frames.size();
  s["sessions"] = sessionsJson(sessions, frames);
  gui_headless::Scene scene;
  scene.prior_maps = {&map};
  auto section = gui_headless::sectionFromRun(output.recorder(), scene, "Map without a session");
  addSessions(sessions, section);
  if (!section.pictures.empty()) output.picture("map.png", section.pictures.front().png);
  gui_headless::Report report;
  report.title = "Vestibule: map";
  report.subtitle = args.extend;
  report.sections.push_back(std::move(section));
  output.report(report);
  output.finish();
  std::printf("%zu scans without session %d\n", frames.size(), *args.cut);
  printMap(map, output);
}

void check(const MapArguments& args, bool known_poses) {
  if (args.log.empty() && !(args.cut && !args.extend.empty())) {
    throw ConfigError(
        "map: give a LOG to map, or --extend DIR with --cut N to leave a session out; see "
        "'vestibule map --help'");
  }
  if (args.cut && args.extend.empty())
    throw ConfigError("--cut needs --extend DIR, the map to cut");
  if (args.init && args.extend.empty()) {
    throw ConfigError("--init is the start in the earlier map: it needs --extend DIR");
  }
  if (args.finish && !args.extend.empty()) {
    throw ConfigError("--finish would move a drive off the map it extends: leave one of them out");
  }
  if (known_poses && (!args.extend.empty() || args.resume || args.georeference || args.finish)) {
    throw ConfigError(
        "--known-poses goes with none of --extend, --resume, --georeference, --finish");
  }
}

}  // namespace

void addMap(CLI::App& app, int& exit_code) {
  struct Options {
    MapArguments args;
    bool known_poses = false;
    std::string init;
  };
  auto o = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("map", "an occupancy map from a recording, as map_server reads it");
  command->add_option("LOG", o->args.log, "recording with laser scans and odometry");
  command->add_flag(
      "--known-poses", o->known_poses, "the poses in the recording are already corrected");
  command->add_option("--config", o->args.config, "YAML as config/default.yaml");
  command->add_option(
      "--gmapping-params", o->args.gmapping_params, "YAML of GMapping parameters by their names");
  command->add_option("--particles", o->args.particles, "number of particles")
      ->check(CLI::Range(1, 10000));
  command->add_option("--seed", o->args.seed, "seed of all randomness");
  command->add_option(
      "--extend", o->args.extend, "output folder of a map run to add this drive to");
  command->add_option("--init", o->init, "start pose x_m,y_m,yaw_rad in the map to extend");
  command->add_option("--cut", o->args.cut, "leave this session of the map to extend out")
      ->check(CLI::PositiveNumber);
  command->add_flag("--resume", o->args.resume, "go on where a killed run in --out stopped");
  command->add_flag(
      "--georeference",
      o->args.georeference,
      "datum and pose of the map from GNSS in the recording");
  command->add_flag(
      "--finish", o->args.finish, "close loops and refine all poses when the drive is over");
  command
      ->add_option(
          "--preview", o->args.preview_scans, "draw OUT/preview.png every so many scans; 0 = never")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--out", o->args.out, "output folder")->required();
  command->callback([o, &exit_code] {
    if (!o->init.empty()) o->args.init = parsePose(o->init);
    check(o->args, o->known_poses);
    exit_code = kDone;
    giveBackFreedBlocks();
    giveBackLibraryPages();
    if (o->known_poses) {
      mapKnownPoses(o->args);
    } else if (o->args.log.empty()) {
      mapWithoutSession(o->args);
    } else {
      exit_code = mapDrive(o->args);
    }
  });
}

}  // namespace vestibule::app
