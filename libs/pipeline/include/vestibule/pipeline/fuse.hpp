#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/events.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/metrics/trajectory.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/progress.hpp"

namespace vestibule::pipeline {

struct FuseResult {
  metrics::Trajectory trajectory;  ///< T_map_base, one per odometry message
  metrics::Trajectory odometry;    ///< T_odom_base at the same stamps
  std::vector<Point2> fixes;       ///< raw GNSS positions in the map frame
  /// Origin of the map frame; empty when the recording is in local metres and keeps its own.
  std::optional<Geodetic> datum;
  std::size_t fixes_accepted = 0;
  std::size_t fixes_refused = 0;
  std::size_t position_resets = 0;
  std::optional<double> ready_after_s;  ///< until position and heading were known
  std::string waiting_for;              ///< what was missing at the end, if they never were
  std::optional<double> gnss_gap_m;     ///< |(last - first estimate) - (last - first fix)|
  double largest_jump_m = 0.0;          ///< between consecutive outputs
  double data_s = 0.0;
  double distance_m = 0.0;
  std::vector<std::string> notes;
};

/// The GNSS/IMU/wheel filter over a recording. Odometry from before position and heading were known
/// is placed when they are, so that the trajectory starts with the recording.
/// Throws InputError for a recording without wheel odometry.
[[nodiscard]] FuseResult fuse(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const Config& config,
    const Observers& observers,
    const Progress& progress);

}  // namespace vestibule::pipeline
