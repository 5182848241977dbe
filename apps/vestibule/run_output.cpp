#include "run_output.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "terminal.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/io/trajectory.hpp"

namespace vestibule::app {

RunOutput::RunOutput(
    const std::string& directory, const std::string& command, const pipeline::Config& config)
    : directory_(directory), events_(directory_.stage("events.jsonl")), event_log_(events_) {
  observers_.attach(event_log_);
  observers_.attach(recorder_);
  summary_["schema"] = "vestibule.summary";
  summary_["schema_version"] = 1;
  summary_["command"] = command;
  summary_["seed"] = config.seed;
  text("config.resolved.yaml", dumpParams(config));
}

void RunOutput::text(const std::string& name, const std::string& content) {
  std::ofstream out(directory_.stage(name), std::ios::binary);
  out << content;
  out.close();
  if (!out) throw ConfigError(pathOf(name) + ": cannot be written (disk full?)");
}

void RunOutput::trajectory(const metrics::Trajectory& poses, const std::string& name) {
  text(name, tumOf(poses));
}

void RunOutput::picture(const std::string& name, const std::string& png) { text(name, png); }

void RunOutput::timing(double wall_s, double data_s) {
  Json timing;
  timing["wall_s"] = rounded(wall_s, 3);
  timing["data_s"] = rounded(data_s, 3);
  timing["real_time_factor"] = wall_s > 0.0 ? rounded(data_s / wall_s, 1) : 0.0;
  text("timing.json", timing.dump(2) + "\n");
}

void RunOutput::report(gui_headless::Report report) {
  report.command_line = commandLine();
  text("report.html", gui_headless::renderReport(report));
}

void RunOutput::finish() {
  events_.close();
  if (!events_) throw ConfigError(pathOf("events.jsonl") + ": cannot be written (disk full?)");
  text("summary.json", summary_.dump(2) + "\n");
  checkInterrupted();
  directory_.commit();
}

std::vector<pipeline::MapPtr> mapsForPictures(
    const geo::Site& site, std::vector<std::string>* notes) {
  std::vector<pipeline::MapPtr> maps;
  for (const geo::IndoorMap& indoor : site.indoor_maps) {
    try {
      maps.push_back(pipeline::loadIndoorMap(indoor, notes));
    } catch (const std::runtime_error& error) {
      std::fprintf(stderr, "not in the pictures: %s\n", error.what());
    }
  }
  return maps;
}

double rounded(double value, int decimals) {
  const double scale = std::pow(10.0, decimals);
  return std::round(value * scale) / scale;
}

Json toJson(const metrics::Statistics& s, double unit) {
  Json json;
  json["rmse"] = rounded(s.rmse * unit, 6);
  json["mean"] = rounded(s.mean * unit, 6);
  json["std"] = rounded(s.stddev * unit, 6);
  json["median"] = rounded(s.median * unit, 6);
  json["p95"] = rounded(s.p95 * unit, 6);
  json["max"] = rounded(s.max * unit, 6);
  return json;
}

Json georeferenceJson(const io::MapGeoreference& g) {
  Json json;
  json["datum"] = {g.datum.lat_deg, g.datum.lon_deg, g.datum.height_m};
  json["T_map_grid"] = {
      rounded(g.T_map_grid.x, 4),
      rounded(g.T_map_grid.y, 4),
      rounded(radToDeg(g.T_map_grid.phi), 4)};
  json["sigma_m"] = {rounded(std::sqrt(g.cov(0, 0)), 4), rounded(std::sqrt(g.cov(1, 1)), 4)};
  json["sigma_yaw_deg"] = rounded(radToDeg(std::sqrt(g.cov(2, 2))), 4);
  return json;
}

std::string tumOf(const metrics::Trajectory& poses) {
  std::string text;
  for (const metrics::TimedPose& p : poses) text += io::formatTumLine({p.stamp, toPose3(p.pose)});
  return text;
}

metrics::Trajectory readPlanarTum(const std::string& path) {
  metrics::Trajectory poses;
  for (const io::StampedPose& p : io::readTum(path)) poses.push_back({p.stamp, toPose2(p.T)});
  return poses;
}

std::vector<std::pair<Timestamp, Pose2>> asReference(const metrics::Trajectory& poses) {
  std::vector<std::pair<Timestamp, Pose2>> reference;
  reference.reserve(poses.size());
  for (const metrics::TimedPose& p : poses) reference.emplace_back(p.stamp, p.pose);
  return reference;
}

std::vector<double> parseNumbers(
    const std::string& option, const std::string& text, std::size_t count, const char* form) {
  std::vector<double> values;
  const char* at = text.c_str();
  for (std::size_t i = 0; i < count; ++i) {
    char* end = nullptr;
    values.push_back(std::strtod(at, &end));
    const bool separated = i + 1 == count ? *end == '\0' : *end == ',';
    if (end == at || !separated || !std::isfinite(values.back())) {
      throw ConfigError(option + " " + text + ": must be " + form);
    }
    at = end + 1;
  }
  return values;
}

Pose2 parsePose(const std::string& text) {
  const auto v = parseNumbers("--init", text, 3, "x_m,y_m,yaw_rad, e.g. 1.5,-2,0.78");
  return {v[0], v[1], wrapToPi(v[2])};
}

gui_headless::Figure figureAtMost(
    const std::string& label, double value, int decimals, const std::string& unit, double limit) {
  gui_headless::Figure f = figure(label, fixed(value, decimals), unit);
  char bar[40];
  std::snprintf(bar, sizeof bar, "<= %g", limit);
  f.bar = bar;
  f.verdict =
      value <= limit ? gui_headless::Figure::Verdict::kGood : gui_headless::Figure::Verdict::kBad;
  return f;
}

gui_headless::Figure figure(
    const std::string& label, const std::string& value, const std::string& unit) {
  gui_headless::Figure f;
  f.label = label;
  f.value = value;
  f.unit = unit;
  return f;
}

}  // namespace vestibule::app
