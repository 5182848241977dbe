#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "run_output.hpp"
#include "terminal.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/gui_headless/charts.hpp"
#include "vestibule/tuning/calibration.hpp"
#include "vestibule/tuning/parameter_tree.hpp"

namespace vestibule::app {
namespace {

using tuning::Calibration;
using tuning::OdometryCalibration;
using tuning::Quantity;

struct Arguments {
  std::string log;
  std::string ref;
  std::string config;
  std::string csv_mapping;
  double track_m = 0.0;
  bool arm_known = false;
  std::string out;
};

io::RecordingOptions recordingOptions(const Arguments& args, const pipeline::Config& config) {
  io::RecordingOptions options;
  options.rig = config.rig;
  options.csv_mapping = args.csv_mapping;
  options.csv_mapping_dir = shipped("config/csv");
  return options;
}

bool allObserved(const Calibration& c) {
  return std::all_of(c.quantities.begin(), c.quantities.end(), [](const Quantity& q) {
    return q.unobserved.empty();
  });
}

/// Into summary, tables and on the terminal: what was found, and what was not and why.
void report(
    const Calibration& c, RunOutput& output, gui_headless::ReportSection& section, int& exit_code) {
  gui_headless::Table table;
  table.title = "Calibration";
  table.header = {"quantity", "before", "found", "one sigma", "unit", ""};
  std::vector<std::vector<std::string>> rows{{"", "before", "found", "one sigma", "", ""}};
  std::size_t observed = 0;
  for (const Quantity& q : c.quantities) {
    Json json;
    json["before"] = rounded(q.before, 6);
    std::vector<std::string> row{q.name, fixed(q.before, 4)};
    if (q.unobserved.empty()) {
      ++observed;
      json["value"] = rounded(q.value, 6);
      json["sigma"] = rounded(q.sigma, 6);
      row.insert(row.end(), {fixed(q.value, 4), fixed(q.sigma, 4), q.unit, ""});
    } else {
      json["unobserved"] = q.unobserved;
      row.insert(row.end(), {"-", "-", q.unit, "not observable here: " + q.unobserved});
    }
    output.summary()["quantities"][q.name] = json;
    table.rows.push_back(row);
    rows.push_back(row);
  }
  section.tables.push_back(std::move(table));
  std::printf("%s", textTable(rows).c_str());
  for (const tuning::Residuals& r : c.residuals) {
    Json& json = output.summary()["residuals"][r.of];
    json["unit"] = r.unit;
    json["before"] = rounded(r.rmsBefore(), 6);
    json["after"] = rounded(r.rmsAfter(), 6);
    std::printf(
        "misfit of the %s, RMS: %.4f %s before, %.4f %s after\n",
        r.of.c_str(),
        r.rmsBefore(),
        r.unit.c_str(),
        r.rmsAfter(),
        r.unit.c_str());
    section.figures.push_back(
        figure("misfit of the " + r.of + ", RMS, before", fixed(r.rmsBefore(), 4), r.unit));
    section.figures.push_back(figure("... after", fixed(r.rmsAfter(), 4), r.unit));
    gui_headless::LineChart chart;
    chart.title = "Misfit of the " + r.of;
    chart.y_label = "misfit [" + r.unit + "]";
    chart.series.push_back({"before", gui_headless::SeriesLook::kSecond, r.before});
    chart.series.push_back({"after", gui_headless::SeriesLook::kEstimate, r.after});
    section.charts.push_back(gui_headless::lineChart(chart));
  }
  for (const std::string& note : c.notes) section.text += (section.text.empty() ? "" : "; ") + note;
  output.summary()["notes"] = c.notes;
  // Nothing found: the recording failed the purpose.
  if (observed == 0) exit_code = kFailedPurpose;
}

void finish(
    const Arguments& args,
    const std::string& what,
    RunOutput& output,
    gui_headless::ReportSection section) {
  gui_headless::Report page;
  page.title = "Vestibule: calibrate " + what;
  page.subtitle = args.log;
  page.sections.push_back(std::move(section));
  output.report(page);
  output.finish();
  std::printf("report: %s\n", output.pathOf("report.html").c_str());
}

void emitPath(const metrics::Trajectory& path, const Observers& observers) {
  for (const metrics::TimedPose& p : path) {
    PoseEvent event;
    event.stamp = p.stamp;
    event.source = PoseSource::kPublished;
    event.T.mean = p.pose;
    observers.emit(event);
  }
}

std::string pathPicture(
    const std::string& words,
    const metrics::Trajectory& path,
    const metrics::Trajectory& reference) {
  gui_headless::RunRecorder recorder;
  Observers observers;
  observers.attach(recorder);
  emitPath(path, observers);
  gui_headless::Scene scene;
  scene.reference = asReference(reference);
  gui_headless::OverviewStyle style;
  style.path_words = words;
  return gui_headless::renderOverview(recorder, scene, style);
}

void quickTable(const OdometryCalibration& c, gui_headless::ReportSection& section, Json& s) {
  gui_headless::Table quick;
  quick.title = "Quick procedure: straights and spins alone";
  quick.header = {"", "value"};
  quick.rows.push_back(
      {"true / wheel distance on straights",
       c.quick_scale ? fixed(*c.quick_scale, 4) : "no straight long enough"});
  quick.rows.push_back(
      {c.quick_scale ? "effective track on spins, with that scale [m]"
                     : "effective track on spins, the scale not known [m]",
       c.quick_track_m ? fixed(*c.quick_track_m, 4) : "no spin on the spot long enough"});
  section.tables.push_back(std::move(quick));
  if (c.quick_scale) s["quick"]["scale"] = rounded(*c.quick_scale, 6);
  if (c.quick_track_m) s["quick"]["effective_track_m"] = rounded(*c.quick_track_m, 6);
}

void umbmarkTable(const OdometryCalibration& c, gui_headless::ReportSection& section, Json& s) {
  const tuning::UmbMark& u = c.umbmark;
  gui_headless::Table table;
  table.title = "UMBmark: where a 4 m square of the uncorrected odometry truly ends";
  table.header = {"", "value"};
  table.rows = {
      {"clockwise: x, y [m]", fixed(u.gravity_cw.x, 3) + ", " + fixed(u.gravity_cw.y, 3)},
      {"counter-clockwise: x, y [m]", fixed(u.gravity_ccw.x, 3) + ", " + fixed(u.gravity_ccw.y, 3)},
      {"alpha (track) [deg]", fixed(radToDeg(u.alpha_rad), 3)},
      {"beta (wheel diameters) [deg]", fixed(radToDeg(u.beta_rad), 3)},
      {"E_d, right / left wheel", fixed(u.wheel_ratio, 5)},
      {"E_b, effective / believed track", fixed(u.track_ratio, 4)}};
  section.tables.push_back(std::move(table));
  s["umbmark"]["cw_m"] = {rounded(u.gravity_cw.x, 4), rounded(u.gravity_cw.y, 4)};
  s["umbmark"]["ccw_m"] = {rounded(u.gravity_ccw.x, 4), rounded(u.gravity_ccw.y, 4)};
  s["umbmark"]["E_d"] = rounded(u.wheel_ratio, 6);
  s["umbmark"]["E_b"] = rounded(u.track_ratio, 6);
}

void calibrateOdometry(const Arguments& args, int& exit_code) {
  const pipeline::Config config = pipeline::loadConfig(args.config);
  RunOutput output(args.out, "calibrate odometry", config);
  ProgressBar bar("calibrate odometry");
  const auto data = tuning::readOdometry(
      args.log, args.ref, recordingOptions(args, config), config, bar.callback());
  const OdometryCalibration c = tuning::calibrateOdometry(
      data.odometry, data.reference, data.has_position, args.track_m, data.errors);
  output.timing(bar.wallSeconds(), 0.0);
  output.summary()["input"] = args.log;
  output.summary()["reference"] = data.reference_name;
  output.summary()["track_m"] = args.track_m;
  gui_headless::ReportSection section;
  section.title = "Wheels against " + data.reference_name;
  exit_code = kDone;
  report(c, output, section, exit_code);
  quickTable(c, section, output.summary());
  if (allObserved(c)) umbmarkTable(c, section, output.summary());
  section.pictures.push_back(
      {"odometry as recorded (line), reference (dashed)",
       pathPicture("recorded", c.before, c.reference)});
  section.pictures.push_back(
      {"odometry as calibrated (line), reference (dashed)",
       pathPicture("calibrated", c.after, c.reference)});
  output.picture("before.png", section.pictures[0].png);
  output.picture("after.png", section.pictures[1].png);
  output.trajectory(c.after);
  finish(args, "odometry", output, std::move(section));
}

/// How well the measurements fit for stamps that are late by so much.
void offsetCurve(
    const tuning::OffsetCurve& curve, const Calibration& c, gui_headless::ReportSection& section) {
  gui_headless::LineChart chart;
  chart.title = curve.of + ": misfit over the delay";
  chart.x_label = "late by [s]";
  chart.y_label = curve.misfit;
  chart.series.push_back({"misfit", gui_headless::SeriesLook::kEstimate, curve.points});
  const Quantity* q = c.find(curve.of);
  if (q != nullptr && q->unobserved.empty()) chart.markers.push_back({q->value, "found"});
  section.charts.push_back(gui_headless::lineChart(chart));
}

void calibrateOffsets(const Arguments& args, int& exit_code) {
  const pipeline::Config config = pipeline::loadConfig(args.config);
  RunOutput output(args.out, "calibrate offsets", config);
  ProgressBar bar("calibrate offsets");
  const tuning::OffsetsCalibration c = tuning::calibrateOffsets(
      args.log, recordingOptions(args, config), config, args.arm_known, bar.callback());
  output.timing(bar.wallSeconds(), 0.0);
  output.summary()["input"] = args.log;
  output.summary()["arm_known"] = args.arm_known;
  gui_headless::ReportSection section;
  section.title = "Stamps of each sensor against those of the others";
  exit_code = kDone;
  report(c, output, section, exit_code);
  for (const tuning::OffsetCurve& curve : c.curves) offsetCurve(curve, c, section);
  finish(args, "offsets", output, std::move(section));
}

/// The mounting as a file for --config: what was observed, the rest as it was.
std::string rigYaml(const Calibration& c, const pipeline::Config& config) {
  const auto value = [&c](const char* name, double before) {
    const Quantity* q = c.find(name);
    return tuning::shortNumber(q != nullptr && q->unobserved.empty() ? q->value : before);
  };
  const Pose2& laser = config.rig.T_base_laser;
  const Point2& antenna = config.rig.p_base_antenna;
  return "rig:\n  laser: [" + value("laser x", laser.x) + ", " + value("laser y", laser.y) + ", " +
         value("laser yaw", radToDeg(laser.phi)) + "]\n  antenna: [" +
         value("antenna x", antenna.x) + ", " + value("antenna y", antenna.y) +
         "]\n  imu_yaw_deg: " + value("IMU yaw", radToDeg(config.rig.imu_yaw_rad)) +
         "\n  imu_upside_down: " + (config.rig.imu_sign_z < 0.0 ? "true" : "false") + "\n";
}

/// The deviation as a file for --config.
std::string compassYaml(const Calibration& c) {
  constexpr double kLeastSigma_deg = 1.0;
  std::string coefficients;
  double variance = kLeastSigma_deg * kLeastSigma_deg;
  for (const Quantity& q : c.quantities) {
    coefficients += (coefficients.empty() ? "" : ", ") + tuning::shortNumber(q.value);
    variance += q.sigma * q.sigma;
  }
  return "rig:\n  compass:\n    deviation_deg: [" + coefficients +
         "]\n    sigma_deg: " + tuning::shortNumber(std::sqrt(variance)) + "\n";
}

/// A + B sin + C cos + D sin 2 + E cos 2 of the reading, before and as found.
std::string deviationChart(const Calibration& c) {
  gui_headless::LineChart chart;
  chart.title = "Deviation over the heading";
  chart.x_label = "reading, clockwise from north [deg]";
  chart.y_label = "reading less true [deg]";
  const auto curve = [&c](const char* name, gui_headless::SeriesLook look, double Quantity::*of) {
    gui_headless::Series series{name, look, {}};
    for (int deg = 0; deg <= 360; deg += 5) {
      const double h = degToRad(deg);
      const double shapes[] = {1.0, std::sin(h), std::cos(h), std::sin(2 * h), std::cos(2 * h)};
      double sum = 0.0;
      for (std::size_t i = 0; i < c.quantities.size(); ++i) sum += c.quantities[i].*of * shapes[i];
      series.points.emplace_back(deg, sum);
    }
    return series;
  };
  chart.series.push_back(curve("before", gui_headless::SeriesLook::kSecond, &Quantity::before));
  chart.series.push_back(curve("found", gui_headless::SeriesLook::kEstimate, &Quantity::value));
  return gui_headless::lineChart(chart);
}

void calibrateCompass(const Arguments& args, int& exit_code) {
  const pipeline::Config config = pipeline::loadConfig(args.config);
  RunOutput output(args.out, "calibrate compass", config);
  ProgressBar bar("calibrate compass");
  const auto data = tuning::readCompass(
      args.log, args.ref, recordingOptions(args, config), config, bar.callback());
  const Calibration c = tuning::calibrateCompass(data.readings, data.reference, config.rig.compass);
  output.timing(bar.wallSeconds(), 0.0);
  output.summary()["input"] = args.log;
  output.summary()["reference"] = data.reference_name;
  gui_headless::ReportSection section;
  section.title = "Compass against " + data.reference_name;
  exit_code = kDone;
  report(c, output, section, exit_code);
  section.text += (section.text.empty() ? "" : "; ") +
                  std::string(
                      "reading less true, clockwise from north, is A + B sin + C cos + "
                      "D sin 2 + E cos 2 of the reading");
  if (allObserved(c)) {
    section.charts.push_back(deviationChart(c));
    output.text("calibrated.yaml", compassYaml(c));
  } else {
    exit_code = kFailedPurpose;
  }
  finish(args, "compass", output, std::move(section));
}

void calibrateMount(const Arguments& args, int& exit_code) {
  const pipeline::Config config = pipeline::loadConfig(args.config);
  RunOutput output(args.out, "calibrate mount", config);
  ProgressBar bar("calibrate mount");
  const Calibration c =
      tuning::calibrateMount(args.log, recordingOptions(args, config), config, bar.callback());
  output.timing(bar.wallSeconds(), 0.0);
  output.summary()["input"] = args.log;
  output.text("calibrated.yaml", rigYaml(c, config));
  gui_headless::ReportSection section;
  section.title = "Where the sensors sit";
  exit_code = kDone;
  report(c, output, section, exit_code);
  finish(args, "mount", output, std::move(section));
}

CLI::App* addKind(
    CLI::App& calibrate, const std::string& name, const std::string& text, Arguments& args) {
  CLI::App* command = calibrate.add_subcommand(name, text);
  command->add_option("LOG", args.log, "recording")->required();
  command->add_option("--config", args.config, "YAML as config/default.yaml");
  command->add_option(
      "--csv-mapping",
      args.csv_mapping,
      "what the columns of a CSV mean (default: the file of config/csv that fits its header)");
  command->add_option("--out", args.out, "output folder")->required();
  return command;
}

}  // namespace

void addCalibrate(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "calibrate", "wheels, time stamps and mounting, where the recording observes them");
  command->require_subcommand(1);
  CLI::App* odometry =
      addKind(*command, "odometry", "wheel scales, centres of rotation, effective track", *args);
  odometry->add_option("--ref", args->ref, "reference trajectory (TUM)");
  odometry
      ->add_option(
          "--track", args->track_m, "distance of left and right wheels the recorder used [m]")
      ->required()
      ->check(CLI::Range(0.01, 10.0));
  odometry->callback([args, &exit_code] { calibrateOdometry(*args, exit_code); });
  CLI::App* offsets = addKind(*command, "offsets", "how late the stamps of each sensor are", *args);
  offsets->add_flag(
      "--arm-known", args->arm_known, "rig.antenna of the configuration is measured: keep it");
  offsets->callback([args, &exit_code] { calibrateOffsets(*args, exit_code); });
  CLI::App* compass = addKind(*command, "compass", "deviation over the heading", *args);
  compass->add_option("--ref", args->ref, "reference trajectory (TUM)");
  compass->callback([args, &exit_code] { calibrateCompass(*args, exit_code); });
  addKind(*command, "mount", "antenna lever arm, IMU yaw, laser pose", *args)
      ->callback([args, &exit_code] { calibrateMount(*args, exit_code); });
}

}  // namespace vestibule::app
