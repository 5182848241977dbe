#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/events.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/metrics/trajectory.hpp"
#include "vestibule/metrics/transition.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/indoor_maps.hpp"
#include "vestibule/pipeline/progress.hpp"

namespace vestibule::pipeline {

struct ReplayResult {
  metrics::Trajectory published;  ///< T_map_base, one per odometry message from being ready on
  metrics::Trajectory odometry;   ///< T_odom_base at the same stamps
  std::vector<Point2> fixes;      ///< raw GNSS antenna positions in the map frame
  std::optional<double> ready_after_s;
  std::string waiting_for;  ///< what the GNSS filter misses, when nothing was ever published
  Mode final_mode = Mode::kOutdoor;  ///< \pre ready_after_s
  int mode_switches = 0;
  MapChanges map_changes;
  std::array<double, 4> share_in_mode{};  ///< of the published poses, by Mode
  metrics::Step correction;               ///< largest within 100 ms, at the base
  double data_s = 0.0;
  double distance_m = 0.0;
  std::vector<std::string> notes;
};

/// The whole indoor/outdoor estimator over a recording: what the robot would have published there.
/// \param T_map_base_init pose at the first message; empty = found from GNSS and motion
/// Throws InputError for a recording without wheel odometry.
[[nodiscard]] ReplayResult replay(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const geo::Site& site,
    const std::optional<Pose2>& T_map_base_init,
    const Config& config,
    const Observers& observers,
    const Progress& progress);

}  // namespace vestibule::pipeline
