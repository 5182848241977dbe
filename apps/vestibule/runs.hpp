#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "run_output.hpp"
#include "vestibule/pipeline/fuse.hpp"
#include "vestibule/pipeline/localize.hpp"
#include "vestibule/pipeline/map.hpp"
#include "vestibule/pipeline/mission.hpp"

namespace vestibule::app {

/// One run each, shared by its own command and the demo: runs the pipeline, fills the output's
/// files and summary, and gives the section of the report.

struct LocalizeArguments {
  std::string log;
  std::string map;
  std::string config;
  std::string amcl_params;    ///< parameter file of nav2_amcl or amcl
  std::optional<Pose2> init;  ///< empty = global
  pipeline::StartHints hints;
  /// Reference poses for this trajectory; may be empty.
  std::function<metrics::Trajectory(const metrics::Trajectory&)> reference;
  double rmse_bar_m = 0.0;  ///< shown in the report when > 0
  std::string title;
};
/// The configuration with the AMCL parameters on top.
[[nodiscard]] pipeline::Config localizeConfig(const LocalizeArguments& args);
[[nodiscard]] gui_headless::ReportSection runLocalize(
    const LocalizeArguments& args, RunOutput& output, pipeline::LocalizeResult& result);

struct FuseArguments {
  std::string log;
  std::string config;
  std::string csv_mapping;
  std::string reference_tum;
  bool smooth = false;
  double gap_bar_m = 0.0;  ///< of the start-to-end difference to GNSS, shown when > 0
  std::string title;
};
[[nodiscard]] gui_headless::ReportSection runFuse(
    const FuseArguments& args, RunOutput& output, pipeline::FuseResult& result);

/// Where a map run that is killed left what it had, in its output folder.
inline constexpr const char* kJournal = "map.journal";

struct MapArguments {
  std::string log;  ///< empty: only `cut` a session out of `extend`
  std::string config;
  std::string gmapping_params;
  std::optional<int> particles;
  std::optional<std::uint64_t> seed;
  std::optional<Pose2> init;
  std::string extend;      ///< output folder of an earlier map run
  std::optional<int> cut;  ///< session that is left out
  bool resume = false;
  bool georeference = false;
  bool finish = false;
  int preview_scans = 0;
  std::string out;
};
/// The configuration with what the command line says on top.
[[nodiscard]] pipeline::Config mapConfig(const MapArguments& args);
/// The frames of the earlier map without the session to cut. Throws ConfigError for a session that
/// is not there, or is the only one.
[[nodiscard]] std::vector<io::MapFrame> earlierFrames(const MapArguments& args);
/// Which session made what of a map: the summary's `sessions`, and figures for the report where
/// there are several.
[[nodiscard]] Json sessionsJson(
    const mapping::SessionCells& sessions, const std::vector<io::MapFrame>& frames);
void saveSessions(
    const mapping::SessionCells& sessions, const grid::OccupancyMap& map, RunOutput& output);
void addSessions(const mapping::SessionCells& sessions, gui_headless::ReportSection& section);
[[nodiscard]] std::pair<pipeline::MapDriveResult, gui_headless::ReportSection> runMap(
    const MapArguments& args, const pipeline::Config& config, RunOutput& output);

struct MissionArguments {
  std::string mission;
  std::string world;
  std::string config;
  std::uint64_t seed = 1;
  bool record = false;
  std::string title;
};
[[nodiscard]] gui_headless::ReportSection runMissionCommand(
    const MissionArguments& args, RunOutput& output, pipeline::MissionResult& result);

/// The configuration with the seed of the command line.
[[nodiscard]] pipeline::Config missionConfig(const MissionArguments& args);

}  // namespace vestibule::app
