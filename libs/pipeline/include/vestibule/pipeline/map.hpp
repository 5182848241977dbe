#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "vestibule/core/events.hpp"
#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/io/simple_map.hpp"
#include "vestibule/mapping/finish.hpp"
#include "vestibule/mapping/map_quality.hpp"
#include "vestibule/mapping/rbpf.hpp"
#include "vestibule/mapping/scan_node.hpp"
#include "vestibule/mapping/sessions.hpp"
#include "vestibule/metrics/trajectory.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/progress.hpp"

namespace vestibule::pipeline {

struct MapResult {
  grid::OccupancyMap map;
  metrics::Trajectory trajectory;  ///< the recording's own poses, one per laser scan
  double distance_m = 0.0;
  std::vector<std::string> notes;
};

/// Builds a map from a recording whose scans carry corrected robot poses.
/// Throws InputError when there is no scan, or a scan without a pose.
[[nodiscard]] MapResult mapFromKnownPoses(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const Config& config,
    const Observers& observers,
    const Progress& progress);

struct MapDriveOptions {
  std::string journal;  ///< file that a killed run can go on from; empty = none
  bool resume = false;  ///< go on from it
  /// Scans of earlier drives; empty = a new map.
  std::vector<io::MapFrame> before;
  /// Where the drive starts in the earlier map; empty = searched for.
  std::optional<Pose2> T_map_base_init;
  bool georeference = false;
  bool finish = false;  ///< close loops and refine all poses when the drive is over
  /// By what the map is judged; empty = by the filter's own matcher. Maps of different matchers are
  /// compared by one.
  std::optional<mapping::MatcherParams> judge;
  /// Called every so many scans with the map so far; 0 = never.
  std::size_t preview_scans = 0;
  std::function<void(const grid::OccupancyMap&, const metrics::Trajectory&)> preview;
  /// Called after every used scan with the effective number of particles.
  std::function<void(double)> status;
  /// Called once before the drive is finished; progress then starts anew.
  std::function<void()> finishing;
};

/// A used scan and what it did.
struct MapUpdate {
  Timestamp stamp;
  mapping::MapReport report;
};

struct MapDriveResult {
  explicit MapDriveResult(grid::OccupancyMap m) : map(std::move(m)) {}

  grid::OccupancyMap map;
  metrics::Trajectory trajectory;    ///< T_map_base, one per laser scan, in file order
  std::vector<io::MapFrame> frames;  ///< the scans in the map, earlier drives first
  std::string graph_g2o;             ///< of the used scans
  std::vector<MapUpdate> updates;
  std::size_t repeated_updates = 0;  ///< taken from the journal
  mapping::MapQuality quality;
  mapping::SessionCells sessions;
  /// Without its nodes, whose poses are in the trajectory and the frames.
  std::optional<mapping::FinishResult> finished;
  std::optional<io::MapGeoreference> georeference;
  double georeference_rms_m = 0.0;
  std::size_t patch_bytes = 0;  ///< of all particles' maps at the end
  double data_s = 0.0;          ///< largest minus smallest stamp
  double distance_m = 0.0;
  std::vector<std::string> notes;
  /// What is wrong with the recording where it could not be read on; the map is of what came
  /// before.
  std::optional<std::string> damage;
};

/// Maps a drive with the particle filter.
/// Throws InputError for a recording without laser scans or without odometry, without usable fixes
/// where a georeference is wanted, or that does not fit the earlier map.
[[nodiscard]] MapDriveResult mapDrive(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const MapDriveOptions& options,
    const Config& config,
    const Observers& observers,
    const Progress& progress);

/// The map of scans of earlier drives, and which of them made which cell.
struct FramesMap {
  grid::OccupancyMap map;
  mapping::SessionCells sessions;
};
[[nodiscard]] FramesMap mapOfFrames(const std::vector<io::MapFrame>& frames, const Config& config);

}  // namespace vestibule::pipeline
