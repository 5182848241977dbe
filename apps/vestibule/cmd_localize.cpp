#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "run_output.hpp"
#include "runs.hpp"
#include "terminal.hpp"
#include "vestibule/amcl/amcl_names.hpp"
#include "vestibule/amcl/particle_localizer.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/memory.hpp"
#include "vestibule/io/map_io.hpp"

namespace vestibule::app {

pipeline::Config localizeConfig(const LocalizeArguments& args) {
  pipeline::Config config = pipeline::loadConfig(args.config);
  if (!args.amcl_params.empty()) (void)amcl::applyAmclFile(args.amcl_params, config.amcl);
  return config;
}

namespace {

/// No scan moved the given pose, or was searched with.
bool sawNothing(const pipeline::LocalizeResult& result) {
  return result.scans_used == 0 && result.searches == 0;
}

/// Whether the pose at the end is meant.
const char* verdictOf(const pipeline::LocalizeResult& result) {
  return result.trusted_at_end            ? "trusted"
         : sawNothing(result)             ? "NOT KNOWN: no scan could be used, see the events"
         : result.final_state == "unsure" ? "NOT SURE: it may also be elsewhere, see final_places"
                                          : "LOST: the scans do not fit the map there";
}

}  // namespace

gui_headless::ReportSection runLocalize(
    const LocalizeArguments& args, RunOutput& output, pipeline::LocalizeResult& result) {
  std::vector<std::string> notes;
  const auto map = std::make_shared<const grid::OccupancyMap>(io::loadMap(args.map, &notes));
  for (const std::string& note : notes) std::fprintf(stderr, "%s\n", note.c_str());
  amcl::requireUsable(*map, args.map);
  const auto georeference = io::loadGeoreference(args.map);
  const pipeline::Config config = localizeConfig(args);
  io::RecordingOptions options;
  options.rig = config.rig;
  options.csv_mapping_dir = shipped("config/csv");

  double wall_s = 0.0;
  {
    ProgressBar bar("localize");
    result = pipeline::localize(
        args.log,
        options,
        map,
        args.init,
        config,
        output.observers(),
        bar.callback(),
        args.hints,
        georeference);
    wall_s = bar.wallSeconds();
  }
  output.timing(wall_s, result.data_s);
  output.trajectory(result.trajectory);

  metrics::Trajectory reference;
  if (args.reference) reference = args.reference(result.trajectory);

  Json& s = output.summary();
  s["input"] = args.log;
  s["map"] = args.map;
  s["map_notes"] = notes;
  s["start"] = args.init ? "given pose" : "global";
  if (args.hints.near) {
    const auto& near = *args.hints.near;
    s["hints"]["near"] = {near.p_map.x, near.p_map.y, near.sigma_m};
  }
  if (args.hints.heading) {
    s["hints"]["heading_deg"] = {
        rounded(radToDeg(args.hints.heading->yaw_rad), 4),
        rounded(radToDeg(args.hints.heading->sigma_rad), 4)};
  }
  if (args.hints.zone) {
    const auto& [low, high] = *args.hints.zone;
    s["hints"]["zone"] = {low.x, low.y, high.x, high.y};
  }
  s["scans"] = result.trajectory.size();
  s["scans_used"] = result.scans_used;
  s["data_s"] = rounded(result.data_s, 6);
  s["distance_m"] = rounded(result.distance_m, 4);
  s["trusted_share"] = rounded(result.trusted_share, 6);
  s["trusted_at_end"] = result.trusted_at_end;
  s["final_trust"] = rounded(result.final_trust, 6);
  s["mean_lost_probability"] = rounded(result.mean_lost_probability, 6);
  s["final_lost_probability"] = rounded(result.final_lost_probability, 6);
  s["mean_inlier_share"] = rounded(result.mean_inlier_share, 6);
  s["recoveries"] = result.recoveries;
  s["searches"] = result.searches;
  s["searching_scans"] = result.searching_scans;
  if (result.found_at) {
    s["found"]["stamp"] = formatSeconds(*result.found_at);
    s["found"]["after_m"] = rounded(result.found_after_m, 3);
  }
  s["final_state"] = result.final_state;
  s["final_places"] = Json::array();
  for (const auto& [T, weight] : result.final_places) {
    if (weight < 0.001) continue;
    s["final_places"].push_back(
        {rounded(T.mean.x, 4), rounded(T.mean.y, 4), rounded(T.mean.phi, 5), rounded(weight, 4)});
  }
  const Eigen::Matrix3d& cov = result.final_pose.cov;
  s["final_sigma"] = {
      rounded(std::sqrt(cov(0, 0)), 4),
      rounded(std::sqrt(cov(1, 1)), 4),
      rounded(std::sqrt(cov(2, 2)), 5)};
  s["particles_mean"] = rounded(result.mean_particle_count, 1);
  s["particles_max"] = result.largest_particle_count;
  const Pose2& end = result.trajectory.back().pose;
  s["final_pose"] = {rounded(end.x, 6), rounded(end.y, 6), rounded(end.phi, 6)};
  const pipeline::GeoUse& geo = result.geo;
  const std::size_t geo_used = geo.fixes_in_search + geo.fixes_in_weights + geo.headings_in_search;
  if (geo.fixes + geo_used > 0) {
    s["geo"] = {
        {"fixes", geo.fixes},
        {"fixes_in_search", geo.fixes_in_search},
        {"fixes_in_weights", geo.fixes_in_weights},
        {"fixes_far", geo.fixes_far},
        {"headings_in_search", geo.headings_in_search}};
  }
  s["notes"] = result.notes;

  gui_headless::Scene scene;
  scene.prior_maps = {map.get()};
  scene.reference = asReference(reference);
  auto section = gui_headless::sectionFromRun(output.recorder(), scene, args.title);
  section.figures = {
      figure(
          "ends at x, y, yaw",
          fixed(end.x, 2) + " m, " + fixed(end.y, 2) + " m, " + fixed(radToDeg(end.phi), 1) +
              " deg"),
      figure("that pose is", verdictOf(result))};
  if (!args.init && result.found_at) {
    section.figures.push_back(
        figure("start unknown: place found after", fixed(result.found_after_m, 1), "m"));
  }
  if (geo_used > 0) {
    section.figures.push_back(figure(
        "GNSS fixes, headings taken in",
        std::to_string(geo.fixes_in_search + geo.fixes_in_weights) + ", " +
            std::to_string(geo.headings_in_search)));
  }
  const std::vector<gui_headless::Figure> shares{
      figure(
          "probability of being lost, mean", fixed(100.0 * result.mean_lost_probability, 1), "%"),
      figure("scans", std::to_string(result.trajectory.size())),
      figure("distance", fixed(result.distance_m, 1), "m"),
      figure("recording", fixed(result.data_s, 1), "s"),
      figure("speed", fixed(result.data_s / std::max(wall_s, 1e-3), 0), "x real time"),
      figure("particles, mean", fixed(result.mean_particle_count, 0)),
      figure("beams on mapped obstacles, mean", fixed(100.0 * result.mean_inlier_share, 1), "%"),
      figure("scans with a trusted pose", fixed(100.0 * result.trusted_share, 1), "%"),
      figure("searches because the scans did not fit", std::to_string(result.recoveries))};
  section.figures.insert(section.figures.end(), shares.begin(), shares.end());
  if (!reference.empty()) {
    const auto errors = metrics::absoluteErrors(
        metrics::associate(result.trajectory, reference), metrics::Alignment::kNone);
    s["reference"]["matched"] = errors.translation_m.count;
    s["reference"]["translation_m"] = toJson(errors.translation_m);
    s["reference"]["yaw_deg"] = toJson(errors.yaw_rad, radToDeg(1.0));
    section.figures.push_back(
        args.rmse_bar_m > 0.0
            ? figureAtMost("position RMSE", errors.translation_m.rmse, 3, "m", args.rmse_bar_m)
            : figure("position RMSE", fixed(errors.translation_m.rmse, 3), "m"));
    section.figures.push_back(
        figure("position error, largest", fixed(errors.translation_m.max, 3), "m"));
    section.figures.push_back(figure("yaw RMSE", fixed(radToDeg(errors.yaw_rad.rmse), 2), "deg"));
  }
  if (!section.pictures.empty()) output.picture("map.png", section.pictures.front().png);
  if (section.pictures.size() > 1) output.picture("particles.png", section.pictures[1].png);
  return section;
}

namespace {

struct Options {
  LocalizeArguments args;
  std::string init;
  std::string near;
  std::string heading;
  std::string zone;
  std::string ref;
  bool global = false;
  std::string out;
};

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

/// Says what the file of AMCL parameters did, and takes its start pose where none is given.
void tellAmclNames(Options& o) {
  amcl::AmclParams params;
  const amcl::AmclNames names = amcl::applyAmclFile(o.args.amcl_params, params);
  std::printf("%s: %zu parameters taken over", o.args.amcl_params.c_str(), names.applied.size());
  std::printf(names.ignored.empty() ? "\n" : "; without effect here:\n");
  for (const auto& [reason, ignored] : names.ignored) {
    std::printf("  %s (%s)\n", joined(ignored).c_str(), reason.c_str());
  }
  if (!names.unknown.empty()) {
    std::printf("not parameters of AMCL: %s\n", joined(names.unknown).c_str());
  }
  const bool hinted = !o.near.empty() || !o.heading.empty() || !o.zone.empty();
  if (o.init.empty() && !o.global && !hinted && names.T_map_base_init)
    o.args.init = names.T_map_base_init;
}

pipeline::StartHints hintsFrom(const Options& o) {
  pipeline::StartHints hints;
  if (!o.near.empty()) {
    const auto v = parseNumbers("--near", o.near, 3, "x_m,y_m,sigma_m, e.g. 12,3.5,2");
    if (!(v[2] > 0.0)) throw ConfigError("--near " + o.near + ": sigma_m must be > 0");
    hints.near = pipeline::StartHints::Near{{v[0], v[1]}, v[2]};
  }
  if (!o.heading.empty()) {
    const auto v = parseNumbers("--heading", o.heading, 2, "yaw_deg,sigma_deg, e.g. 90,15");
    if (!(v[1] > 0.0)) throw ConfigError("--heading " + o.heading + ": sigma_deg must be > 0");
    hints.heading = pipeline::StartHints::Heading{wrapToPi(degToRad(v[0])), degToRad(v[1])};
  }
  if (!o.zone.empty()) {
    const auto v = parseNumbers("--zone", o.zone, 4, "x0_m,y0_m,x1_m,y1_m, e.g. 0,0,12.5,8");
    if (!(v[0] < v[2] && v[1] < v[3])) {
      throw ConfigError("--zone " + o.zone + ": x0_m < x1_m and y0_m < y1_m");
    }
    hints.zone = pipeline::StartHints::Zone{{v[0], v[1]}, {v[2], v[3]}};
  }
  return hints;
}

}  // namespace

void addLocalize(CLI::App& app, int& exit_code) {
  auto o = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("localize", "where the robot was in a prebuilt map, from a recording");
  command->add_option("LOG", o->args.log, "recording with laser scans and odometry")->required();
  command
      ->add_option("--map", o->args.map, "map_server YAML, MRPT .simplemap[.gz] or .gridmap[.gz]")
      ->required();
  auto* init = command->add_option(
      "--init", o->init, "start pose x_m,y_m,yaw_rad in the map; without it: --global");
  command
      ->add_flag(
          "--global",
          o->global,
          "search the whole map for the start pose; GNSS fixes and calibrated headings of LOG help "
          "where MAP has a georeference (amcl.gnss.in_search)")
      ->excludes(init);
  command
      ->add_option(
          "--near", o->near, "x_m,y_m,sigma_m: about there (last seen, a fix); with --global")
      ->excludes(init);
  command
      ->add_option(
          "--heading",
          o->heading,
          "yaw_deg,sigma_deg in the map, counter-clockwise from x (a compass); with --global")
      ->excludes(init);
  command->add_option("--zone", o->zone, "x0_m,y0_m,x1_m,y1_m: in this rectangle; with --global")
      ->excludes(init);
  command->add_option("--config", o->args.config, "YAML as config/default.yaml");
  command->add_option(
      "--amcl-params",
      o->args.amcl_params,
      "parameter file of nav2_amcl, or parameter or launch file of ROS 1's amcl, on top of "
      "--config");
  command->add_option("--ref", o->ref, "reference trajectory (TUM) for the errors in the report");
  command->add_option("--out", o->out, "output folder")->required();
  command->callback([o, &exit_code] {
    if (!o->init.empty()) o->args.init = parsePose(o->init);
    o->args.hints = hintsFrom(*o);
    if (!o->ref.empty()) {
      const auto reference = readPlanarTum(o->ref);
      o->args.reference = [reference](const metrics::Trajectory&) { return reference; };
    }
    o->args.title = "Localization in a prebuilt map";
    if (!o->args.amcl_params.empty()) tellAmclNames(*o);
    giveBackFreedBlocks();
    giveBackLibraryPages();
    RunOutput output(o->out, "localize", localizeConfig(o->args));
    pipeline::LocalizeResult result;
    gui_headless::Report report;
    report.title = "Vestibule: localize";
    report.subtitle = o->args.log;
    report.sections.push_back(runLocalize(o->args, output, result));
    output.report(report);
    output.finish();

    const Pose2& end = result.trajectory.back().pose;
    std::printf(
        "%zu scans, %.1f m in %.1f s; beams on mapped obstacles %.0f %%; trusted %.0f %% of the "
        "time\n"
        "ends at x %.3f m, y %.3f m, yaw %.2f deg (%s)\nreport: %s\n",
        result.trajectory.size(),
        result.distance_m,
        result.data_s,
        100.0 * result.mean_inlier_share,
        100.0 * result.trusted_share,
        end.x,
        end.y,
        radToDeg(end.phi),
        verdictOf(result),
        output.pathOf("report.html").c_str());
    exit_code = result.trusted_at_end ? kDone : kFailedPurpose;
  });
}

}  // namespace vestibule::app
