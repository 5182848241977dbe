#include <cmath>
#include <cstdio>
#include <filesystem>

#include "commands.hpp"
#include "run_output.hpp"
#include "terminal.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/gui_headless/overview.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/io/recording_info.hpp"
#include "vestibule/io/run_directory.hpp"

namespace vestibule::app {
namespace {

struct Arguments {
  std::string log;
  bool json = false;
  std::string out;
};

/// Size, place and content of a prebuilt map.
void infoOfMap(const Arguments& args) {
  std::vector<std::string> notes;
  const grid::OccupancyMap map = io::loadMap(args.log, &notes);
  const double all = static_cast<double>(map.width()) * static_cast<double>(map.height());
  const auto share = [&](grid::Cell kind) { return static_cast<double>(map.count(kind)) / all; };
  const Pose2 corner = compose(map.T_map_grid(), Pose2{map.corner().x, map.corner().y, 0.0});
  Json info;
  info["map"] = args.log;
  info["cells"] = {map.width(), map.height()};
  info["resolution_m"] = rounded(map.resolution(), 6);
  info["size_m"] = {
      rounded(map.width() * map.resolution(), 3), rounded(map.height() * map.resolution(), 3)};
  info["origin"] = {rounded(corner.x, 6), rounded(corner.y, 6), rounded(corner.phi, 6)};
  info["free_share"] = rounded(share(grid::Cell::kFree), 5);
  info["occupied_share"] = rounded(share(grid::Cell::kOccupied), 5);
  info["unknown_share"] = rounded(share(grid::Cell::kUnknown), 5);
  info["free_m2"] = rounded(
      static_cast<double>(map.count(grid::Cell::kFree)) * map.resolution() * map.resolution(), 2);
  const auto georeference = io::loadGeoreference(args.log);
  if (georeference) info["georeference"] = georeferenceJson(*georeference);
  info["notes"] = notes;
  if (args.json) {
    std::printf("%s\n", info.dump(2).c_str());
  } else {
    std::printf(
        "%s\n"
        "  %d x %d cells of %.4g m: %.2f x %.2f m\n"
        "  lower left corner at x %.3f m, y %.3f m, yaw %.4f rad\n"
        "  free %.1f %% (%.1f m2), occupied %.1f %%, unknown %.1f %%\n",
        args.log.c_str(),
        map.width(),
        map.height(),
        map.resolution(),
        map.width() * map.resolution(),
        map.height() * map.resolution(),
        corner.x,
        corner.y,
        corner.phi,
        100.0 * share(grid::Cell::kFree),
        info["free_m2"].get<double>(),
        100.0 * share(grid::Cell::kOccupied),
        100.0 * share(grid::Cell::kUnknown));
    if (georeference) {
      const io::MapGeoreference& g = *georeference;
      std::printf(
          "  georeference: x %.3f m, y %.3f m, yaw %.3f deg (sigma %.3f m, %.3f m, %.3f deg)\n"
          "    in ENU at latitude %.8f deg, longitude %.8f deg, height %.2f m\n",
          g.T_map_grid.x,
          g.T_map_grid.y,
          radToDeg(g.T_map_grid.phi),
          std::sqrt(g.cov(0, 0)),
          std::sqrt(g.cov(1, 1)),
          radToDeg(std::sqrt(g.cov(2, 2))),
          g.datum.lat_deg,
          g.datum.lon_deg,
          g.datum.height_m);
    }
    for (const std::string& note : notes) std::printf("  %s\n", note.c_str());
  }
  if (map.count(grid::Cell::kFree) == 0) {
    std::printf("  no free cell: nothing can be localized in it; check thresholds and negate\n");
  }
  if (args.out.empty()) return;
  io::RunDirectory directory(args.out);
  gui_headless::Scene scene;
  scene.prior_maps = {&map};
  gui_headless::OverviewStyle style;
  style.title = args.log;
  gui_headless::writeFile(
      directory.stage("map.png").string(),
      gui_headless::renderOverview(gui_headless::RunRecorder(), scene, style));
  gui_headless::writeFile(directory.stage("map_info.json").string(), info.dump(2) + "\n");
  directory.commit();
}

}  // namespace

void addInfo(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "info", "what is in a recording (sensors, rates, gaps, problems) or in a prebuilt map");
  command
      ->add_option(
          "LOG",
          args->log,
          "rawlog, CARMEN log, ROS bag, CSV; or a map: YAML, gridmap, simplemap, .dat")
      ->required();
  command->add_option("--out", args->out, "folder for a picture (maps only)");
  command->add_flag("--json", args->json, "print JSON instead of a table");
  command->callback([args, &exit_code] {
    if (io::isMap(args->log)) {
      infoOfMap(*args);
      exit_code = kDone;
      return;
    }
    if (!args->out.empty()) {
      throw ConfigError(
          "info --out: there is a picture of maps only; leave it out for a recording");
    }
    io::RecordingOptions options;
    options.csv_mapping_dir = shipped("config/csv");
    io::RecordingInfo info;
    {
      ProgressBar bar("info");
      const auto progress = bar.callback();
      info = io::inspectRecording(
          args->log, options, [&progress](double share) { progress(share, 0.0); });
    }
    std::fputs((args->json ? info.toJson() : info.toText()).c_str(), stdout);
    exit_code = kDone;
  });
}

}  // namespace vestibule::app
