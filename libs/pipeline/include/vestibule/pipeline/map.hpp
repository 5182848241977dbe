#pragma once

#include <string>
#include <vector>

#include "vestibule/core/events.hpp"
#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/io/recording.hpp"
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

}  // namespace vestibule::pipeline
