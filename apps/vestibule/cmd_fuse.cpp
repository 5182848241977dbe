#include <algorithm>
#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "run_output.hpp"
#include "runs.hpp"
#include "terminal.hpp"
#include "vestibule/io/trajectory.hpp"

namespace vestibule::app {

gui_headless::ReportSection runFuse(
    const FuseArguments& args, RunOutput& output, pipeline::FuseResult& result) {
  const pipeline::Config config = pipeline::loadConfig(args.config);
  io::RecordingOptions options;
  options.rig = config.rig;
  options.csv_mapping = args.csv_mapping;
  options.csv_mapping_dir = shipped("config/csv");

  double wall_s = 0.0;
  {
    ProgressBar bar("fuse");
    result = pipeline::fuse(args.log, options, config, output.observers(), bar.callback());
    wall_s = bar.wallSeconds();
  }
  output.timing(wall_s, result.data_s);
  output.trajectory(result.trajectory);

  metrics::Trajectory reference;
  if (!args.reference_tum.empty()) {
    reference = readPlanarTum(args.reference_tum);
  } else if (const auto own = io::readReference(args.log, options)) {
    for (const io::StampedPose& p : *own) reference.push_back({p.stamp, toPose2(p.T)});
    output.trajectory(reference, "reference.tum");
  }

  Json& s = output.summary();
  s["input"] = args.log;
  s["data_s"] = rounded(result.data_s, 6);
  s["distance_m"] = rounded(result.distance_m, 4);
  s["outputs"] = result.trajectory.size();
  if (result.datum) {
    s["datum"] = {result.datum->lat_deg, result.datum->lon_deg, result.datum->height_m};
  }
  s["fixes_accepted"] = result.fixes_accepted;
  s["fixes_refused"] = result.fixes_refused;
  s["position_resets"] = result.position_resets;
  s["ready_after_s"] = result.ready_after_s ? Json(rounded(*result.ready_after_s, 6)) : Json();
  s["waiting_for"] = result.waiting_for;
  s["start_to_end_gap_to_gnss_m"] =
      result.gnss_gap_m ? Json(rounded(*result.gnss_gap_m, 4)) : Json();
  s["largest_jump_m"] = rounded(result.largest_jump_m, 6);
  s["notes"] = result.notes;

  gui_headless::Scene scene;
  scene.gnss_fixes = result.fixes;
  scene.reference = asReference(reference);
  auto section = gui_headless::sectionFromRun(output.recorder(), scene, args.title);
  section.figures = {
      figure("recording", fixed(result.data_s, 1), "s"),
      figure("distance", fixed(result.distance_m, 1), "m"),
      figure("speed", fixed(result.data_s / std::max(wall_s, 1e-3), 0), "x real time"),
      figure(
          "fixes used / refused",
          std::to_string(result.fixes_accepted) + " / " + std::to_string(result.fixes_refused)),
      figure("largest jump between outputs", fixed(result.largest_jump_m, 3), "m")};
  if (result.ready_after_s) {
    section.figures.push_back(
        figure("position and heading known after", fixed(*result.ready_after_s, 1), "s"));
  }
  if (result.gnss_gap_m) {
    const char* label = "start-to-end difference to GNSS";
    section.figures.push_back(
        args.gap_bar_m > 0.0 ? figureAtMost(label, *result.gnss_gap_m, 2, "m", args.gap_bar_m)
                             : figure(label, fixed(*result.gnss_gap_m, 2), "m"));
  }
  if (!reference.empty()) {
    metrics::AssociationOptions association;
    association.matching = metrics::Matching::kInterpolated;
    association.max_dt = std::chrono::seconds(2);
    const auto errors = metrics::absoluteErrors(
        metrics::associate(result.trajectory, reference, association), metrics::Alignment::kNone);
    s["reference"]["matched"] = errors.translation_m.count;
    s["reference"]["translation_m"] = toJson(errors.translation_m);
    s["reference"]["yaw_deg"] = toJson(errors.yaw_rad, radToDeg(1.0));
    section.figures.push_back(figure("position RMSE", fixed(errors.translation_m.rmse, 2), "m"));
    section.figures.push_back(
        figure("position error, median", fixed(errors.translation_m.median, 2), "m"));
    section.figures.push_back(
        figure("position error, 95 %", fixed(errors.translation_m.p95, 2), "m"));
  }
  if (!section.pictures.empty()) output.picture("map.png", section.pictures.front().png);
  return section;
}

void addFuse(CLI::App& app, int& exit_code) {
  struct Options {
    FuseArguments args;
    std::string out;
  };
  auto o = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("fuse", "GNSS, IMU and wheels of a recording into one trajectory");
  command->add_option("LOG", o->args.log, "ROS 1 bag, MRPT rawlog or CSV")->required();
  command->add_option("--config", o->args.config, "YAML as config/default.yaml");
  command->add_option(
      "--csv-mapping",
      o->args.csv_mapping,
      "what the columns of a CSV mean (default: the file of config/csv that fits its header)");
  command->add_option("--ref", o->args.reference_tum, "reference trajectory (TUM)");
  command->add_option("--out", o->out, "output folder")->required();
  command->callback([o, &exit_code] {
    o->args.title = "GNSS, IMU and wheels";
    RunOutput output(o->out, "fuse", pipeline::loadConfig(o->args.config));
    pipeline::FuseResult result;
    gui_headless::Report report;
    report.title = "Vestibule: fuse";
    report.subtitle = o->args.log;
    report.command_line = "vestibule fuse " + o->args.log;
    report.sections.push_back(runFuse(o->args, output, result));
    output.report(report);
    output.finish();

    std::printf(
        "%.1f s, %.1f m, %zu poses\n", result.data_s, result.distance_m, result.trajectory.size());
    if (result.fixes.empty()) {
      std::printf("no GNSS in the recording: the trajectory is odometry from its own start\n");
    } else if (!result.ready_after_s) {
      std::printf(
          "the map frame was never reached (%s): the trajectory is odometry from its own start\n",
          result.waiting_for.c_str());
    } else {
      std::printf(
          "position and heading known after %.1f s; fixes used %zu, refused %zu; largest jump %.3f "
          "m\n",
          *result.ready_after_s,
          result.fixes_accepted,
          result.fixes_refused,
          result.largest_jump_m);
    }
    std::printf("report: %s\n", output.pathOf("report.html").c_str());
    exit_code = !result.fixes.empty() && !result.ready_after_s ? kFailedPurpose : kDone;
  });
}

}  // namespace vestibule::app
