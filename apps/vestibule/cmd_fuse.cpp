#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "run_output.hpp"
#include "runs.hpp"
#include "terminal.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/gui_headless/charts.hpp"
#include "vestibule/io/geodetic_track.hpp"
#include "vestibule/io/trajectory.hpp"

namespace vestibule::app {
namespace {

io::RecordingOptions recordingOptions(const FuseArguments& args, const pipeline::Config& config) {
  io::RecordingOptions options;
  options.rig = config.rig;
  options.csv_mapping = args.csv_mapping;
  options.csv_mapping_dir = shipped("config/csv");
  return options;
}

/// The trajectory on the globe, where the recording says where on the globe it is.
void writeGeodetic(RunOutput& output, const pipeline::FuseResult& result) {
  if (!result.datum || !result.ready_after_s) return;
  const geo::TangentPlane plane(result.datum->position);
  io::GeodeticTrack track;
  for (const io::StampedPose& p : result.poses) {
    track.push_back(
        {p.stamp, plane.toGeodetic({p.T.x, p.T.y, p.T.z}), p.T.roll, p.T.pitch, p.T.yaw});
  }
  output.text("trajectory.geojson", io::formatGeoJson(track, "vestibule"));
  output.text("trajectory.kml", io::formatKml(track, "vestibule"));
  output.text("trajectory_geodetic.csv", io::formatGeodeticCsv(track));
}

/// What the filter learnt and how it drove, over time.
std::vector<std::string> charts(const pipeline::FuseResult& result) {
  using gui_headless::LineChart;
  using gui_headless::Series;
  using gui_headless::SeriesLook;
  if (result.samples.empty()) return {};
  const Timestamp start = result.trajectory.front().stamp;
  Series speed{"speed", SeriesLook::kEstimate, {}};
  Series yaw{"yaw", SeriesLook::kEstimate, {}};
  Series bias{"bias", SeriesLook::kEstimate, {}};
  Series bias_low{"95 %", SeriesLook::kBound, {}};
  Series bias_high{"", SeriesLook::kBound, {}};
  Series scale{"scale", SeriesLook::kEstimate, {}};
  Series scale_low{"95 %", SeriesLook::kBound, {}};
  Series scale_high{"", SeriesLook::kBound, {}};
  for (const pipeline::FuseSample& x : result.samples) {
    const double t = toSeconds(x.stamp - start);
    speed.points.emplace_back(t, x.speed_mps);
    yaw.points.emplace_back(t, radToDeg(x.yaw_rad));
    const double b = radToDeg(x.gyro_bias_radps);
    const double db = 1.96 * radToDeg(x.gyro_bias_sigma_radps);
    bias.points.emplace_back(t, b);
    bias_low.points.emplace_back(t, b - db);
    bias_high.points.emplace_back(t, b + db);
    const double s = 100.0 * std::expm1(x.wheel_scale);
    const double ds = 196.0 * x.wheel_scale_sigma;
    scale.points.emplace_back(t, s);
    scale_low.points.emplace_back(t, s - ds);
    scale_high.points.emplace_back(t, s + ds);
  }
  const auto chart = [](const char* title, const char* y, std::vector<Series> series) {
    LineChart c;
    c.title = title;
    c.y_label = y;
    c.series = std::move(series);
    c.include_zero = false;
    return gui_headless::lineChart(c);
  };
  return {
      chart("Speed", "speed [m/s]", {speed}),
      chart("Heading", "yaw [deg]", {yaw}),
      chart("Gyro bias", "bias [deg/s]", {bias, bias_low, bias_high}),
      chart("True distance per wheel distance", "off by [%]", {scale, scale_low, scale_high})};
}

}  // namespace

gui_headless::ReportSection runFuse(
    const FuseArguments& args, RunOutput& output, pipeline::FuseResult& result) {
  const pipeline::Config config = pipeline::loadConfig(args.config);
  const io::RecordingOptions options = recordingOptions(args, config);

  double wall_s = 0.0;
  {
    ProgressBar bar("fuse");
    pipeline::FuseOptions fuse_options;
    fuse_options.smooth = args.smooth;
    result =
        pipeline::fuse(args.log, options, config, fuse_options, output.observers(), bar.callback());
    wall_s = bar.wallSeconds();
  }
  output.timing(wall_s, result.data_s);
  std::string tum;
  for (const io::StampedPose& p : result.poses) tum += io::formatTumLine(p);
  output.text("trajectory.tum", tum);
  if (args.smooth) output.trajectory(result.filtered, "filtered.tum");
  writeGeodetic(output, result);

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
    const Geodetic& d = result.datum->position;
    s["datum"] = {d.lat_deg, d.lon_deg, d.height_m};
    s["datum_sigma_m"] = rounded(result.datum->sigma_m, 3);
    s["datum_fixes"] = result.datum->fixes;
  }
  s["fixes_accepted"] = result.fixes_accepted;
  s["fixes_refused"] = result.fixes_refused;
  s["position_resets"] = result.position_resets;
  s["ready_after_s"] = result.ready_after_s ? Json(rounded(*result.ready_after_s, 6)) : Json();
  s["waiting_for"] = result.waiting_for;
  s["start_to_end_gap_to_gnss_m"] =
      result.gnss_gap_m ? Json(rounded(*result.gnss_gap_m, 4)) : Json();
  s["largest_jump_m"] = rounded(result.largest_jump_m, 6);
  s["dropped"] = Json::object();
  for (const auto& [reason, count] : result.dropped) s["dropped"][reason] = count;
  s["stood_out"] = result.stood_out;
  if (result.smoothing_m) s["smoothing_moved_m"] = toJson(*result.smoothing_m);
  s["notes"] = result.notes;

  gui_headless::Scene scene;
  scene.gnss_fixes = result.fixes;
  scene.reference = asReference(reference);
  auto section = gui_headless::sectionFromRun(output.recorder(), scene, args.title);
  for (const std::string& words : result.stood_out) {
    section.text += (section.text.empty() ? "" : "\n\n") + words + ".";
  }
  for (std::string& svg : charts(result)) section.charts.push_back(std::move(svg));
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
  if (result.datum && result.datum->fixes > 0) {
    section.figures.push_back(figure(
        "datum: mean of " + std::to_string(result.datum->fixes) + " fixes, one sigma",
        fixed(result.datum->sigma_m, 2),
        "m"));
  }
  if (result.smoothing_m) {
    section.figures.push_back(figure(
        "smoothed against filtered: median / largest difference",
        fixed(result.smoothing_m->median, 2) + " / " + fixed(result.smoothing_m->max, 2),
        "m"));
  }
  if (!reference.empty()) {
    metrics::AssociationOptions association;
    association.matching = metrics::Matching::kInterpolated;
    association.max_dt = std::chrono::seconds(2);
    const auto errors = metrics::absoluteErrors(
        metrics::associate(result.trajectory, reference, association), metrics::Alignment::kNone);
    if (args.smooth) {
      const auto filtered = metrics::absoluteErrors(
          metrics::associate(result.filtered, reference, association), metrics::Alignment::kNone);
      s["reference"]["filtered_translation_m"] = toJson(filtered.translation_m);
      section.figures.push_back(
          figure("position RMSE of the filter alone", fixed(filtered.translation_m.rmse, 2), "m"));
    }
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

namespace {

struct HiddenOutages {
  double length_s = 0.0;
  double median_m = 0.0;
  double p95_m = 0.0;
  double covered = 0.0;  ///< share
  std::vector<pipeline::Outage> each;
};

HiddenOutages hideFixes(const FuseArguments& args, double length_s) {
  const pipeline::Config config = pipeline::loadConfig(args.config);
  ProgressBar bar("hide fixes");
  HiddenOutages result;
  result.length_s = length_s;
  result.each = pipeline::hiddenOutages(
      args.log, recordingOptions(args, config), config, length_s, bar.callback());
  std::vector<double> errors;
  for (const pipeline::Outage& o : result.each) {
    errors.push_back(o.error_m);
    if (o.covered) result.covered += 1.0 / static_cast<double>(result.each.size());
  }
  if (errors.empty()) {
    throw ConfigError(
        args.log + ": --hidden-outages: no window of " + fixed(length_s, 0) +
        " s with fixes after position and heading are known; try shorter ones");
  }
  const metrics::Statistics statistics = metrics::statistics(errors);
  result.median_m = statistics.median;
  result.p95_m = statistics.p95;
  return result;
}

void report(
    const std::vector<HiddenOutages>& all,
    RunOutput& output,
    gui_headless::ReportSection& section) {
  if (all.empty()) return;
  gui_headless::Table table;
  table.title = "Without GNSS: error at the end of each window, against the hidden fixes";
  table.header = {"window", "windows", "median [m]", "95 % [m]", "inside the 95 % ellipse"};
  Json& json = output.summary()["hidden_outages"];
  for (const HiddenOutages& o : all) {
    Json entry;
    entry["length_s"] = o.length_s;
    entry["windows"] = o.each.size();
    entry["median_m"] = rounded(o.median_m, 3);
    entry["p95_m"] = rounded(o.p95_m, 3);
    entry["covered_share"] = rounded(o.covered, 3);
    json.push_back(entry);
    table.rows.push_back(
        {fixed(o.length_s, 0) + " s",
         std::to_string(o.each.size()),
         fixed(o.median_m, 2),
         fixed(o.p95_m, 2),
         fixed(100.0 * o.covered, 0) + " %"});
    std::printf(
        "fixes hidden for %.0f s: %zu windows, end error median %.2f m, 95 %% %.2f m, %.0f %% "
        "inside the 95 %% ellipse\n",
        o.length_s,
        o.each.size(),
        o.median_m,
        o.p95_m,
        100.0 * o.covered);
  }
  section.tables.push_back(table);
}

void report(
    const std::vector<pipeline::StampOffset>& offsets,
    RunOutput& output,
    gui_headless::ReportSection& section) {
  if (offsets.empty()) return;
  gui_headless::Table table;
  table.title = "Stamps against those of the other sensors";
  table.header = {"sensor", "late by [s]", "one sigma [s]", "found"};
  for (const pipeline::StampOffset& o : offsets) {
    Json entry;
    entry["sensor"] = o.sensor;
    entry["offset_s"] = rounded(o.offset_s, 4);
    entry["sigma_s"] = rounded(o.sigma_s, 4);
    entry["found"] = o.found;
    output.summary()["stamp_offsets"].push_back(entry);
    table.rows.push_back(
        {o.sensor, fixed(o.offset_s, 3), fixed(o.sigma_s, 3), o.found ? "yes" : "no"});
    std::printf(
        "%s stamps are late by %.3f +- %.3f s%s\n",
        o.sensor.c_str(),
        o.offset_s,
        o.sigma_s,
        o.found ? "" : " (no clear minimum within 1.5 s)");
  }
  section.tables.push_back(table);
}

}  // namespace

void addFuse(CLI::App& app, int& exit_code) {
  struct Options {
    FuseArguments args;
    std::string out;
    std::vector<double> hidden_s;
    bool offsets = false;
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
  command->add_flag(
      "--smooth", o->args.smooth, "every pose from the whole recording, before and after it");
  command
      ->add_option(
          "--hidden-outages",
          o->hidden_s,
          "also hide the fixes for windows of so many seconds, e.g. 30,60, and score their ends")
      ->delimiter(',')
      ->check(CLI::Range(1.0, 3600.0));
  command->add_flag(
      "--estimate-offsets", o->offsets, "also estimate how late each sensor's stamps are");
  command->add_option("--out", o->out, "output folder")->required();
  command->callback([o, &exit_code] {
    o->args.title = "GNSS, IMU and wheels";
    RunOutput output(o->out, "fuse", pipeline::loadConfig(o->args.config));
    pipeline::FuseResult result;
    gui_headless::Report page;
    page.title = "Vestibule: fuse";
    page.subtitle = o->args.log;
    gui_headless::ReportSection section = runFuse(o->args, output, result);
    std::vector<HiddenOutages> outages;
    for (const double length_s : o->hidden_s) outages.push_back(hideFixes(o->args, length_s));
    report(outages, output, section);
    if (o->offsets) {
      const pipeline::Config config = pipeline::loadConfig(o->args.config);
      ProgressBar bar("offsets");
      report(
          pipeline::estimateOffsets(
              o->args.log, recordingOptions(o->args, config), config, {}, bar.callback()),
          output,
          section);
    }
    page.sections.push_back(std::move(section));
    output.report(page);
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
