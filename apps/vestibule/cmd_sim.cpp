#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "commands.hpp"
#include "run_output.hpp"
#include "terminal.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/io/rawlog_writer.hpp"
#include "vestibule/io/trajectory.hpp"
#include "vestibule/metrics/trajectory.hpp"
#include "vestibule/sim/scenario.hpp"

namespace vestibule::app {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string scenario;
  std::string record;
  std::string out;
  std::uint64_t seed = 1;
  bool list = false;
};

/// What one drive left behind.
struct Drive {
  metrics::Trajectory truth;
  std::vector<Point2> fixes;
  std::map<std::string, std::size_t> messages;             ///< by sensor label
  std::map<std::string, std::vector<double>> gnss_errors;  ///< horizontal [m] by fix type
  double duration_s = 0.0;
  double wall_s = 0.0;
  double distance_m = 0.0;
  bool collided = false;
};

constexpr Duration kTick = std::chrono::milliseconds(20);

/// True antenna position at a stamp, which lies at most a few ticks back.
Point2 antennaAt(const metrics::Trajectory& truth, Timestamp stamp, const Point2& p_base_antenna) {
  const auto after = std::lower_bound(
      truth.begin(), truth.end(), stamp, [](const metrics::TimedPose& p, Timestamp t) {
        return p.stamp < t;
      });
  if (after == truth.end()) return transform(truth.back().pose, p_base_antenna);
  if (after == truth.begin()) return transform(after->pose, p_base_antenna);
  const auto before = std::prev(after);
  const double s = toSeconds(stamp - before->stamp) / toSeconds(after->stamp - before->stamp);
  return transform(interpolate(before->pose, after->pose, s), p_base_antenna);
}

Drive drive(const sim::Scenario& scenario, std::uint64_t seed, io::RawlogWriter& recording) {
  Drive result;
  sim::ScenarioRun run(scenario, seed);
  const geo::TangentPlane plane(scenario.world.datum);
  ProgressBar bar("sim");
  const auto progress = bar.callback();
  result.truth.push_back({run.simulator().time(), run.simulator().truth()});
  while (!run.finished()) {
    const auto arrived = run.step(kTick);
    result.truth.push_back({run.simulator().time(), run.simulator().truth()});
    for (const sim::Delivered& delivered : arrived) {
      const Measurement& measurement = delivered.measurement;
      const std::string label = io::labelOf(measurement);
      ++result.messages[label];
      recording.write(measurement, label);
      const auto* fix = std::get_if<GnssFix>(&measurement);
      if (fix == nullptr || fix->type == GnssFixType::kNone) continue;
      const Eigen::Vector3d enu = plane.toEnu(std::get<Geodetic>(fix->position));
      const Point2 truth = antennaAt(result.truth, fix->stamp, scenario.sim.rig.p_base_antenna);
      result.fixes.push_back({enu.x(), enu.y()});
      result.gnss_errors[std::string(toString(fix->type))].push_back(
          std::hypot(enu.x() - truth.x, enu.y() - truth.y));
    }
    for (const LidarSweep& sweep : run.simulator().takeSweeps()) {
      ++result.messages["SWEEP"];
      recording.write(sweep, "SWEEP");
    }
    progress(run.progress(), run.elapsed());
  }
  result.duration_s = run.elapsed();
  result.wall_s = bar.wallSeconds();
  result.distance_m = run.simulator().distanceDriven();
  result.collided = run.simulator().collided();
  return result;
}

gui_headless::ReportSection describeDrive(
    const sim::Scenario& scenario, const Drive& d, RunOutput& output) {
  Json& s = output.summary();
  s["scenario"] = scenario.name;
  s["set"] = scenario.set;
  s["duration_s"] = rounded(d.duration_s, 3);
  s["distance_m"] = rounded(d.distance_m, 3);
  s["collided"] = d.collided;
  for (const auto& [label, count] : d.messages) s["messages"][label] = count;
  gui_headless::ReportSection section;
  section.title = scenario.name;
  section.figures = {
      figure("duration", fixed(d.duration_s, 1), "s"),
      figure("driven", fixed(d.distance_m, 1), "m"),
      figure("speed", fixed(d.duration_s / std::max(d.wall_s, 1e-3), 0), "x real time")};
  for (const auto& [label, count] : d.messages) {
    section.figures.push_back(figure(label + " messages", std::to_string(count)));
  }
  for (const auto& [type, errors] : d.gnss_errors) {
    const metrics::Statistics statistics = metrics::statistics(errors);
    s["gnss_error_m"][type] = toJson(statistics);
    s["gnss_error_m"][type]["count"] = errors.size();
    section.figures.push_back(figure(
        "GNSS " + type + ": median / 95 % / largest error",
        fixed(statistics.median, 2) + " / " + fixed(statistics.p95, 2) + " / " +
            fixed(statistics.max, 2),
        "m"));
  }
  gui_headless::Scene scene;
  const std::optional<geo::Site> site = sim::siteAsTold(scenario);
  if (site) scene.site = &*site;
  const sim::WorldGeometry geometry(scenario.world);
  for (const sim::Segment& segment : geometry.segments()) {
    scene.truth_walls.emplace_back(segment.a, segment.b);
  }
  scene.gnss_fixes = d.fixes;
  scene.reference = asReference(d.truth);
  const std::string png = gui_headless::renderOverview(output.recorder(), scene);
  section.pictures.push_back({"true drive and raw fixes", png});
  output.picture("map.png", png);
  return section;
}

/// A file that gets its name when it is finished, and is gone when it never is.
class UnfinishedFile {
 public:
  explicit UnfinishedFile(std::string path) : path_(std::move(path)) {}
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;
  ~UnfinishedFile() {
    std::error_code ignored;
    fs::remove(name(), ignored);
  }
  [[nodiscard]] std::string name() const { return path_ + ".part"; }
  void finish() {
    std::error_code error;
    fs::rename(name(), path_, error);
    if (error) throw ConfigError(path_ + ": cannot be written: " + error.message());
  }

 private:
  std::string path_;
};

/// The site as the estimators are told it, for a site file in `folder`.
std::string siteText(geo::Site site, const fs::path& folder) {
  for (geo::IndoorMap& map : site.indoor_maps) {
    map.yaml_path = fs::relative(map.yaml_path, folder).string();
  }
  return dumpParams(site);
}

/// What to type to try the estimators on the recording.
std::string replayCommand(
    const sim::Scenario& scenario,
    const std::string& recording,
    const std::string& site,
    const std::string& truth) {
  std::string command = "vestibule replay " + recording + " --site " + site;
  if (const auto start = sim::startAsTold(scenario)) {
    command +=
        " --init " + fixed(start->x, 3) + "," + fixed(start->y, 3) + "," + fixed(start->phi, 6);
  }
  return command + " --ref " + truth;
}

void runSim(const Arguments& args, int& exit_code) {
  const std::string folder = shipped("config/scenarios");
  if (args.list) {
    std::vector<std::vector<std::string>> rows{{"scenario", "set", "world"}};
    for (const std::string& name : sim::scenarioNames(folder)) {
      const sim::Scenario scenario = sim::loadScenario(name, folder);
      rows.push_back({name, scenario.set, scenario.world.name});
    }
    std::fputs(textTable(rows).c_str(), stdout);
    return;
  }
  if (args.scenario.empty()) throw ConfigError("--scenario NAME is missing; --list shows them");
  if (args.record.empty() && args.out.empty()) {
    throw ConfigError("nothing would be kept: give --record FILE.rawlog or --out FOLDER");
  }
  const sim::Scenario scenario = sim::loadScenario(args.scenario, folder);
  std::unique_ptr<RunOutput> output;
  if (!args.out.empty()) {
    pipeline::Config config;
    config.seed = args.seed;
    config.rig = scenario.sim.rig;
    output = std::make_unique<RunOutput>(args.out, "sim", config);
  }
  const auto site = sim::siteAsTold(scenario);
  std::optional<UnfinishedFile> single;
  if (!args.record.empty()) single.emplace(args.record);
  const std::string record = output ? output->stage("recording.rawlog") : single->name();
  io::RawlogWriter recording(record);
  const Drive d = drive(scenario, args.seed, recording);
  recording.close();
  checkInterrupted();
  if (single) {
    const fs::path base = fs::absolute(args.record);
    const std::string truth = fs::path(base).replace_extension(".truth.tum").string();
    gui_headless::writeFile(truth, tumOf(d.truth));
    if (output) fs::copy_file(record, single->name(), fs::copy_options::overwrite_existing);
    single->finish();
    std::printf("recording: %s\ntruth: %s\n", args.record.c_str(), truth.c_str());
    if (site) {
      const std::string told = fs::path(base).replace_extension(".site.yaml").string();
      gui_headless::writeFile(told, siteText(*site, base.parent_path()));
      std::printf(
          "try it: %s --out FOLDER\n", replayCommand(scenario, args.record, told, truth).c_str());
    }
  }
  if (output) {
    output->timing(d.wall_s, d.duration_s);
    output->trajectory(d.truth);
    output->trajectory(d.truth, "truth.tum");
    output->text("scenario.resolved.yaml", sim::dumpScenario(scenario));
    if (site) {
      output->text("site.yaml", siteText(*site, fs::absolute(args.out)));
      output->summary()["replay"] =
          replayCommand(scenario, "recording.rawlog", "site.yaml", "truth.tum") +
          " --config config.resolved.yaml";
    }
    gui_headless::Report report;
    report.title = "Vestibule: sim";
    report.subtitle = scenario.name + " in the world " + scenario.world.name;
    report.sections.push_back(describeDrive(scenario, d, *output));
    output->report(report);
    output->finish();
    std::printf("report: %s\n", output->pathOf("report.html").c_str());
  }
  std::printf(
      "%.1f s, %.1f m driven, %.0f x real time%s\n",
      d.duration_s,
      d.distance_m,
      d.duration_s / std::max(d.wall_s, 1e-3),
      d.collided ? "; the robot ran into something" : "");
  exit_code = d.collided ? kFailedPurpose : kDone;
}

}  // namespace

void addSim(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "sim", "drives a scripted scenario in the simulator and records it with its truth");
  command->add_option("--scenario", args->scenario, "name of a shipped scenario, or a YAML file");
  command->add_flag("--list", args->list, "list the shipped scenarios");
  command->add_option("--seed", args->seed, "seed of all randomness")->capture_default_str();
  command->add_option(
      "--record",
      args->record,
      "MRPT rawlog to write; the truth goes beside it as .truth.tum, the site as .site.yaml");
  command->add_option("--out", args->out, "output folder with recording, truth and report");
  command->callback([args, &exit_code] { runSim(*args, exit_code); });
}

}  // namespace vestibule::app
