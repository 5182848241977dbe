#pragma once

#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/events.hpp"
#include "vestibule/gui_headless/overview.hpp"
#include "vestibule/gui_headless/report.hpp"
#include "vestibule/gui_headless/run_recorder.hpp"
#include "vestibule/gui_headless/scene.hpp"
#include "vestibule/io/event_log.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/io/run_directory.hpp"
#include "vestibule/metrics/trajectory.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/indoor_maps.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::app {

using Json = nlohmann::ordered_json;

/// What every run leaves behind: trajectory.tum, summary.json, events.jsonl, config.resolved.yaml,
/// timing.json (the only file that differs from run to run), pictures and report.html. Everything
/// gets its final name together, in finish().
class RunOutput {
 public:
  /// \param command "localize", "fuse", ...; goes into the summary
  RunOutput(
      const std::string& directory, const std::string& command, const pipeline::Config& config);

  [[nodiscard]] Observers& observers() { return observers_; }
  [[nodiscard]] const gui_headless::RunRecorder& recorder() const { return recorder_; }
  /// Starts with schema, command and seed; add the run's figures.
  [[nodiscard]] Json& summary() { return summary_; }

  void trajectory(const metrics::Trajectory& poses, const std::string& name = "trajectory.tum");
  void picture(const std::string& name, const std::string& png);
  void text(const std::string& name, const std::string& content);
  [[nodiscard]] std::string stage(const std::string& name) {
    return directory_.stage(name).string();
  }
  /// Wall time and real-time factor.
  void timing(double wall_s, double data_s);
  /// With the command line in it.
  void report(gui_headless::Report report);
  /// Writes the summary and gives everything its final name.
  void finish();

  [[nodiscard]] std::string pathOf(const std::string& name) const {
    return (directory_.path() / name).string();
  }

 private:
  io::RunDirectory directory_;
  std::ofstream events_;
  io::EventLog event_log_;
  gui_headless::RunRecorder recorder_;
  Observers observers_;
  Json summary_;
};

/// The indoor maps of a site for the pictures after a run. One that cannot be read any more is
/// missing there, and stderr says so: the run is worth more than its picture.
/// \param notes  told what was noted of them
[[nodiscard]] std::vector<pipeline::MapPtr> mapsForPictures(
    const geo::Site& site, std::vector<std::string>* notes = nullptr);

/// Rounds to what is worth keeping, so that a summary stays readable.
[[nodiscard]] double rounded(double value, int decimals);

[[nodiscard]] Json toJson(const metrics::Statistics& s, double unit = 1.0);

/// Datum, pose and one sigma of where a map lies.
[[nodiscard]] Json georeferenceJson(const io::MapGeoreference& georeference);

/// A trajectory as the text of a TUM file.
[[nodiscard]] std::string tumOf(const metrics::Trajectory& poses);

/// Reads a TUM file as a planar trajectory.
[[nodiscard]] metrics::Trajectory readPlanarTum(const std::string& path);

/// As the report wants it.
[[nodiscard]] std::vector<std::pair<Timestamp, Pose2>> asReference(
    const metrics::Trajectory& poses);

/// `count` finite numbers of the command line, separated by commas. Throws ConfigError that names
/// the option and the form for anything else.
[[nodiscard]] std::vector<double> parseNumbers(
    const std::string& option, const std::string& text, std::size_t count, const char* form);
/// "x,y,yaw_rad" of the command line. Throws ConfigError for anything else.
[[nodiscard]] Pose2 parsePose(const std::string& text);

/// A row of the figures table with its verdict against an upper limit.
[[nodiscard]] gui_headless::Figure figureAtMost(
    const std::string& label, double value, int decimals, const std::string& unit, double limit);
[[nodiscard]] gui_headless::Figure figure(
    const std::string& label, const std::string& value, const std::string& unit = {});

}  // namespace vestibule::app
