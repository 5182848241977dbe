#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "vestibule/core/events.hpp"
#include "vestibule/ekf/filter.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/io/trajectory.hpp"
#include "vestibule/metrics/statistics.hpp"
#include "vestibule/metrics/trajectory.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/progress.hpp"

namespace vestibule::pipeline {

/// Origin of the map frame for recordings with geodetic fixes.
struct Datum {
  Geodetic position;
  double sigma_m = 0.0;   ///< per axis, of the mean of the fixes it was made from
  std::size_t fixes = 0;  ///< 0: given by the configuration
};

/// The filter's view of itself at one output, for the report.
struct FuseSample {
  Timestamp stamp;
  double speed_mps = 0.0;
  double yaw_rad = 0.0;
  double gyro_bias_radps = 0.0;
  double gyro_bias_sigma_radps = 0.0;
  double wheel_scale = 0.0;
  double wheel_scale_sigma = 0.0;
};

struct FuseResult {
  metrics::Trajectory trajectory;   ///< T_map_base, one per odometry message
  io::Trajectory poses;             ///< the same with height, roll and pitch
  metrics::Trajectory odometry;     ///< T_odom_base at the same stamps
  std::vector<FuseSample> samples;  ///< where position and heading are known
  std::vector<Point2> fixes;        ///< raw GNSS positions in the map frame
  /// Empty when the recording is in local metres and keeps its own origin.
  std::optional<Datum> datum;
  std::size_t fixes_accepted = 0;
  std::size_t fixes_refused = 0;
  std::size_t position_resets = 0;
  ekf::Dropped dropped;                 ///< measurements of no use, by reason
  std::optional<double> ready_after_s;  ///< until position and heading were known
  std::string waiting_for;              ///< what was missing at the end, if they never were
  std::optional<double> gnss_gap_m;     ///< |(last - first estimate) - (last - first fix)|
  double largest_jump_m = 0.0;          ///< between consecutive outputs
  double data_s = 0.0;
  double distance_m = 0.0;
  /// With smoothing: the filter's own trajectory, and how far the smoothed one is from it.
  metrics::Trajectory filtered;
  std::optional<metrics::Statistics> smoothing_m;
  std::vector<std::string> stood_out;  ///< in words, for people
  std::vector<std::string> notes;
};

struct FuseOptions {
  bool smooth = false;       ///< every pose from the whole recording
  double gnss_late_s = 0.0;  ///< taken off the stamps of the fixes
};

/// The GNSS/IMU/wheel filter over a recording. Odometry from before position and heading were known
/// is placed when they are, so that the trajectory starts with the recording.
/// Throws InputError for a recording without wheel odometry.
[[nodiscard]] FuseResult fuse(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const Config& config,
    const FuseOptions& options,
    const Observers& observers,
    const Progress& progress);

/// What became of the estimate without GNSS.
struct Outage {
  double start_s = 0.0;  ///< after the first measurement
  double error_m = 0.0;  ///< of the antenna at the last hidden fix
  double travel_m = 0.0;
  bool covered = false;  ///< within the 95 % ellipse of what the filter expected of that fix
};

/// Hides the fixes of every window of `length_s` that starts on a multiple of 10 s, one window at a
/// time, from where the filter is ready, and compares its end with the hidden fixes.
/// Throws InputError for a recording without wheel odometry.
[[nodiscard]] std::vector<Outage> hiddenOutages(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const Config& config,
    double length_s,
    const Progress& progress);

/// How late the stamps of a sensor are against those of the others.
struct StampOffset {
  std::string sensor;     ///< "gnss", "heading", "wheels"
  double offset_s = 0.0;  ///< to be subtracted from its stamps
  double sigma_s = 0.0;   ///< by curvature and by the scatter of stretches of 20 s, the larger
  bool found = false;     ///< false: no minimum within +-1.5 s
  /// (offset [s], minus twice the log likelihood of the innovations above its least), ascending.
  std::vector<std::pair<double, double>> misfits;
};
/// By the likelihood of the innovations, each sensor alone: where two are late against the gyro,
/// each comes out as if it were the only one.
/// \param known_s  by how much the stamps of a sensor are late: taken off, and not estimated
[[nodiscard]] std::vector<StampOffset> estimateOffsets(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const Config& config,
    const std::map<std::string, double>& known_s,
    const Progress& progress);

}  // namespace vestibule::pipeline
