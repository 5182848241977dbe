#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>

#include "commands.hpp"
#include "run_output.hpp"
#include "runs.hpp"
#include "terminal.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::app {
namespace {

constexpr const char* kMrptDatasets = "/usr/share/mrpt/datasets/";

/// The UWB recording's reference: lines `index x y yaw`, one per pair of odometry and scan, in
/// order.
std::vector<Pose2> readStepReference(const std::string& path) {
  std::ifstream in(path);
  if (!in) {
    throw InputError(path + ": cannot be read; it belongs to the Debian package mrpt-common");
  }
  std::vector<Pose2> poses;
  std::size_t number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    if (line.empty() || line[0] == '%' || line[0] == '#') continue;
    std::istringstream fields(line);
    double index = 0.0;
    Pose2 pose;
    if (!(fields >> index >> pose.x >> pose.y >> pose.phi)) {
      throw InputError(path + ":" + std::to_string(number) + ": must be `index x y yaw`");
    }
    poses.push_back(pose);
  }
  if (poses.empty()) throw InputError(path + ": no reference pose in it");
  return poses;
}

gui_headless::Figure summaryRow(
    const std::string& label, const gui_headless::Figure& figure, const std::string& note) {
  gui_headless::Figure row = figure;
  row.label = label;
  row.note = note;
  return row;
}

const gui_headless::Figure& find(
    const gui_headless::ReportSection& section, const std::string& label) {
  for (const auto& f : section.figures) {
    if (f.label == label) return f;
  }
  throw std::logic_error("the report section has no figure '" + label + "'");
}

class Demo {
 public:
  explicit Demo(std::string directory)
      : directory_(std::move(directory)), output_(directory_, "demo", {}) {}

  int run() {
    std::printf("1/4 indoors, real: localization in a prebuilt map (363 s, reference known)\n");
    indoorTracking();
    std::printf("2/4 indoors, real: the same without knowing the start\n");
    indoorGlobal();
    std::printf("3/4 outdoors, real: GNSS, IMU and wheels of a Husky (395 s)\n");
    outdoor();
    std::printf("4/4 through the door, simulated: the feeding round of a farm robot\n");
    mission();

    report_.title = "Vestibule: the tour";
    report_.subtitle =
        "Two real recordings indoors, one outdoors, and one mission through the door";
    output_.report(report_);
    Json& s = output_.summary();
    for (const auto& f : report_.summary) {
      Json row;
      row["figure"] = f.label;
      row["value"] = f.value;
      row["unit"] = f.unit;
      row["bar"] = f.bar;
      row["good"] = f.verdict != gui_headless::Figure::Verdict::kBad;
      s["figures"].push_back(row);
    }
    output_.finish();

    std::vector<std::vector<std::string>> rows{{"figure", "value", "unit", "bar", ""}};
    bool good = true;
    for (const auto& f : report_.summary) {
      const bool bad = f.verdict == gui_headless::Figure::Verdict::kBad;
      good = good && !bad;
      rows.push_back(
          {f.label, f.value, f.unit, f.bar, f.bar.empty() ? "" : (bad ? "MISSED" : "ok")});
    }
    std::printf(
        "\n%s\nreport: %s\n", textTable(rows).c_str(), output_.pathOf("report.html").c_str());
    return good ? kDone : kFailedPurpose;
  }

 private:
  /// Finishes one part: its own page in its own folder, and its section on the common page.
  void finishPart(RunOutput& part, gui_headless::ReportSection section) {
    gui_headless::Report page;
    page.title = section.title;
    page.sections.push_back(section);
    part.report(page);
    part.finish();
    report_.sections.push_back(std::move(section));
  }

  [[nodiscard]] std::string folder(const std::string& name) const {
    return (std::filesystem::path(directory_) / name).string();
  }

  void indoorTracking() {
    const std::string base = std::string(kMrptDatasets) + "uwb_ro-localization_demo";
    const auto reference = readStepReference(base + "_GT.txt");
    LocalizeArguments args;
    args.log = base + ".rawlog";
    args.map = base + "_map.gridmap.gz";
    args.init = reference.front();
    args.rmse_bar_m = 0.16;
    args.title = "Indoors, real: tracking in a prebuilt map";
    args.reference = [&reference](const metrics::Trajectory& estimate) {
      metrics::Trajectory poses;
      // The recording opens with a scan that has no odometry before it, and so no row.
      const std::size_t skip = estimate.size() - std::min(estimate.size(), reference.size());
      for (std::size_t i = skip; i < estimate.size(); ++i) {
        poses.push_back({estimate[i].stamp, reference[i - skip]});
      }
      return poses;
    };
    RunOutput part(folder("indoor"), "localize", {});
    pipeline::LocalizeResult result;
    auto section = runLocalize(args, part, result);
    report_.summary.push_back(summaryRow(
        "indoors: position RMSE",
        find(section, "position RMSE"),
        "its reference is itself only good to 0.15 m"));
    finishPart(part, std::move(section));
  }

  void indoorGlobal() {
    LocalizeArguments args;
    args.log = std::string(kMrptDatasets) + "localization_demo.rawlog";
    args.map = std::string(kMrptDatasets) + "localization_demo.simplemap.gz";
    args.title = "Indoors, real: start unknown";
    RunOutput part(folder("indoor_global"), "localize", {});
    pipeline::LocalizeResult result;
    auto section = runLocalize(args, part, result);
    // Where the recording ends, from the map's own documentation.
    const Pose2 expected_end{15.89, -10.0, 0.0};
    const auto miss = figureAtMost(
        "end position off by", distance(result.trajectory.back().pose, expected_end), 3, "m", 0.15);
    section.figures.push_back(miss);
    report_.summary.push_back(
        summaryRow("indoors, start unknown: end off by", miss, "against its documented end"));
    finishPart(part, std::move(section));
  }

  void outdoor() {
    FuseArguments args;
    args.log = shipped("datasets/husky_gnss/test1.bag");
    args.gap_bar_m = 3.0;
    args.title = "Outdoors, real: GNSS, IMU and wheels";
    RunOutput part(folder("outdoor"), "fuse", {});
    pipeline::FuseResult result;
    auto section = runFuse(args, part, result);
    report_.summary.push_back(summaryRow(
        "outdoors: start-to-end difference to GNSS",
        find(section, "start-to-end difference to GNSS"),
        "359 m driven"));
    report_.summary.push_back(summaryRow(
        "outdoors: largest jump between outputs",
        figureAtMost("", result.largest_jump_m, 3, "m", 0.3),
        "motion included"));
    finishPart(part, std::move(section));
  }

  void mission() {
    MissionArguments args;
    args.mission = shipped("config/missions/farm_feeding.yaml");
    args.world = shipped("config/worlds/farm.yaml");
    args.title = "Through the door: feeding round on the farm (simulated)";
    RunOutput part(folder("mission"), "mission", missionConfig(args));
    pipeline::MissionResult result;
    auto section = runMissionCommand(args, part, result);
    for (const char* label :
         {"waypoints reached in order",
          "collisions in the true world",
          "largest pose step per 100 ms",
          "largest yaw step per 100 ms"}) {
      report_.summary.push_back(
          summaryRow(std::string("through the door: ") + label, find(section, label), ""));
    }
    report_.summary.push_back(summaryRow(
        "through the door: error within 10 m of a door",
        figureAtMost("", result.door_zone.max_m, 3, "m", 0.5),
        "largest, RTK-class GNSS"));
    finishPart(part, std::move(section));
  }

  std::string directory_;
  RunOutput output_;
  gui_headless::Report report_;
};

}  // namespace

void addDemo(CLI::App& app, int& exit_code) {
  auto out = std::make_shared<std::string>("out/demo");
  CLI::App* command = app.add_subcommand(
      "demo", "the tour: real recordings indoors and outdoors, and a mission through the door");
  command->add_option("--out", *out, "output folder")->capture_default_str();
  command->callback([out, &exit_code] { exit_code = Demo(*out).run(); });
}

}  // namespace vestibule::app
