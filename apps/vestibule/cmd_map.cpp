#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "run_output.hpp"
#include "terminal.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/pipeline/map.hpp"

namespace vestibule::app {

void addMap(CLI::App& app, int& exit_code) {
  struct Options {
    std::string log;
    std::string config;
    bool known_poses = false;
    std::string out;
  };
  auto o = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("map", "an occupancy map from a recording, as map_server reads it");
  command->add_option("LOG", o->log, "recording with laser scans")->required();
  command
      ->add_flag(
          "--known-poses", o->known_poses, "the poses in the recording are already corrected")
      ->required();
  command->add_option("--config", o->config, "YAML as config/default.yaml");
  command->add_option("--out", o->out, "output folder")->required();
  command->callback([o, &exit_code] {
    const pipeline::Config config = pipeline::loadConfig(o->config);
    io::RecordingOptions options;
    options.rig = config.rig;
    options.csv_mapping_dir = shipped("config/csv");
    RunOutput output(o->out, "map", config);
    double wall_s = 0.0;
    const pipeline::MapResult result = [&] {
      ProgressBar bar("map");
      auto r =
          pipeline::mapFromKnownPoses(o->log, options, config, output.observers(), bar.callback());
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
    s["input"] = o->log;
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
    report.subtitle = o->log;
    report.command_line = "vestibule map " + o->log + " --known-poses";
    report.sections.push_back(std::move(section));
    output.report(report);
    const double span_s =
        toSeconds(result.trajectory.back().stamp - result.trajectory.front().stamp);
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
    exit_code = kDone;
  });
}

}  // namespace vestibule::app
