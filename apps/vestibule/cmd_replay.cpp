#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "run_output.hpp"
#include "terminal.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/pipeline/replay.hpp"

namespace vestibule::app {
namespace {

struct Arguments {
  std::string log;
  std::string site;
  std::string init;
  std::string config;
  std::string csv_mapping;
  std::string reference_tum;
  std::string out;
};

constexpr std::array kModes{Mode::kOutdoor, Mode::kIndoor, Mode::kDeadReckoning, Mode::kLost};

void fillSummary(Json& s, const Arguments& args, const pipeline::ReplayResult& result) {
  s["input"] = args.log;
  s["site"] = args.site;
  s["start"] = args.init.empty() ? "found" : "given pose";
  s["data_s"] = rounded(result.data_s, 6);
  s["distance_m"] = rounded(result.distance_m, 4);
  s["outputs"] = result.published.size();
  s["ready_after_s"] = result.ready_after_s ? Json(rounded(*result.ready_after_s, 6)) : Json();
  s["waiting_for"] = result.waiting_for;
  s["mode_switches"] = result.mode_switches;
  s["maps_loaded"] = result.map_changes.loaded;
  s["maps_unloaded"] = result.map_changes.unloaded;
  for (const Mode mode : kModes) {
    s["share_in_mode"][std::string(toString(mode))] =
        rounded(result.share_in_mode[static_cast<std::size_t>(mode)], 6);
  }
  s["final_mode"] = result.ready_after_s ? Json(toString(result.final_mode)) : Json();
  s["correction_step_100ms"]["position_m"] = rounded(result.correction.position_m, 6);
  s["correction_step_100ms"]["yaw_deg"] = rounded(radToDeg(result.correction.yaw_rad), 6);
  s["notes"] = result.notes;
}

gui_headless::ReportSection runReplay(
    const Arguments& args, RunOutput& output, pipeline::ReplayResult& result) {
  const pipeline::Config config = pipeline::loadConfig(args.config);
  const geo::Site site = geo::loadSite(args.site);
  std::optional<Pose2> init;
  if (!args.init.empty()) init = parsePose(args.init);
  metrics::Trajectory reference;
  if (!args.reference_tum.empty()) reference = readPlanarTum(args.reference_tum);
  io::RecordingOptions options;
  options.rig = config.rig;
  options.csv_mapping = args.csv_mapping;
  options.csv_mapping_dir = shipped("config/csv");

  double wall_s = 0.0;
  {
    ProgressBar bar("replay");
    result =
        pipeline::replay(args.log, options, site, init, config, output.observers(), bar.callback());
    wall_s = bar.wallSeconds();
  }
  output.timing(wall_s, result.data_s);
  output.trajectory(result.published);
  output.trajectory(result.odometry, "odometry.tum");
  fillSummary(output.summary(), args, result);

  gui_headless::Scene scene;
  scene.site = &site;
  std::vector<std::string> map_notes;
  const auto maps = mapsForPictures(site, &map_notes);
  for (const std::string& note : map_notes) std::fprintf(stderr, "%s\n", note.c_str());
  for (const auto& map : maps) scene.prior_maps.push_back(map.get());
  scene.gnss_fixes = result.fixes;
  scene.reference = asReference(reference);
  auto section = gui_headless::sectionFromRun(
      output.recorder(), scene, "Indoors, outdoors and through the door");
  section.figures = {
      figure("recording", fixed(result.data_s, 1), "s"),
      figure("distance", fixed(result.distance_m, 1), "m"),
      figure("speed", fixed(result.data_s / std::max(wall_s, 1e-3), 0), "x real time"),
      figure(
          "first pose after",
          result.ready_after_s ? fixed(*result.ready_after_s, 1) : "never",
          result.ready_after_s ? "s" : ""),
      figure("changes of authority", std::to_string(result.mode_switches)),
      figureAtMost("largest pose step per 100 ms", result.correction.position_m, 3, "m", 0.05),
      figureAtMost(
          "largest yaw step per 100 ms", radToDeg(result.correction.yaw_rad), 3, "deg", 0.5)};
  for (const Mode mode : kModes) {
    const double share = result.share_in_mode[static_cast<std::size_t>(mode)];
    if (share <= 0.0) continue;
    section.figures.push_back(
        figure("time " + std::string(toString(mode)), fixed(100.0 * share, 1), "%"));
  }
  if (!reference.empty() && !result.published.empty()) {
    metrics::AssociationOptions association;
    association.matching = metrics::Matching::kInterpolated;
    const auto errors = metrics::absoluteErrors(
        metrics::associate(result.published, reference, association), metrics::Alignment::kNone);
    Json& s = output.summary();
    s["reference"]["matched"] = errors.translation_m.count;
    s["reference"]["translation_m"] = toJson(errors.translation_m);
    s["reference"]["yaw_deg"] = toJson(errors.yaw_rad, radToDeg(1.0));
    section.figures.push_back(figure("position RMSE", fixed(errors.translation_m.rmse, 3), "m"));
    section.figures.push_back(
        figure("position error, 95 %", fixed(errors.translation_m.p95, 3), "m"));
    section.figures.push_back(
        figure("position error, largest", fixed(errors.translation_m.max, 3), "m"));
    section.figures.push_back(figure("yaw RMSE", fixed(radToDeg(errors.yaw_rad.rmse), 2), "deg"));
  }
  if (!section.pictures.empty()) output.picture("map.png", section.pictures.front().png);
  return section;
}

}  // namespace

void addReplay(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "replay",
      "what the robot would have published on a recording: indoors, outdoors and between");
  command->add_option("LOG", args->log, "ROS 1 bag, MRPT rawlog, CARMEN log or CSV")->required();
  command->add_option("--site", args->site, "site YAML: datum, buildings, doors, indoor maps")
      ->required();
  command->add_option(
      "--init",
      args->init,
      "start pose x_m,y_m,yaw_rad in the site's map frame; without it: found from GNSS and motion");
  command->add_option("--config", args->config, "YAML as config/default.yaml");
  command->add_option(
      "--csv-mapping",
      args->csv_mapping,
      "what the columns of a CSV mean (default: the file of config/csv that fits its header)");
  command->add_option(
      "--ref", args->reference_tum, "reference trajectory (TUM) for the errors in the report");
  command->add_option("--out", args->out, "output folder")->required();
  command->callback([args, &exit_code] {
    RunOutput output(args->out, "replay", pipeline::loadConfig(args->config));
    pipeline::ReplayResult result;
    gui_headless::Report report;
    report.title = "Vestibule: replay";
    report.subtitle = args->log + " at " + args->site;
    report.sections.push_back(runReplay(*args, output, result));
    output.report(report);
    output.finish();

    const bool lost = result.ready_after_s && result.final_mode == Mode::kLost;
    if (!result.ready_after_s) {
      std::printf("no pose was ever published; missing: %s\n", result.waiting_for.c_str());
    } else {
      const Pose2& end = result.published.back().pose;
      std::printf(
          "%.1f s, %.1f m; first pose after %.1f s; %d changes of authority; largest step %.3f m "
          "in 100 ms\nends at x %.3f m, y %.3f m, yaw %.2f deg (%s)\n",
          result.data_s,
          result.distance_m,
          *result.ready_after_s,
          result.mode_switches,
          result.correction.position_m,
          end.x,
          end.y,
          radToDeg(end.phi),
          std::string(toString(result.final_mode)).c_str());
    }
    std::printf("report: %s\n", output.pathOf("report.html").c_str());
    exit_code = result.ready_after_s && !lost ? kDone : kFailedPurpose;
  });
}

}  // namespace vestibule::app
