#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "vestibule/core/events.hpp"
#include "vestibule/core/frames.hpp"
#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/metrics/trajectory.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/progress.hpp"

namespace vestibule::pipeline {

/// What became of the GNSS fixes and headings in a recording.
struct GeoUse {
  std::size_t fixes = 0;               ///< with a position
  std::size_t fixes_in_search = 0;     ///< that were a prior of a search
  std::size_t fixes_in_weights = 0;    ///< that weighed the particles
  std::size_t fixes_far = 0;           ///< from the map: not of a robot that is in it
  std::size_t headings_in_search = 0;  ///< that were a prior of a search
};

struct LocalizeResult {
  metrics::Trajectory trajectory;  ///< T_map_base, one per laser scan, in file order
  std::size_t scans_used = 0;      ///< that moved the particles
  double trusted_share = 0.0;      ///< of the scans
  double mean_inlier_share = 0.0;
  double final_trust = 0.0;
  double mean_lost_probability = 0.0;
  double final_lost_probability = 0.0;
  bool trusted_at_end = false;
  int recoveries = 0;  ///< searches because the scans did not fit
  int searches = 0;    ///< of the whole map
  /// Scans during which the pose was only the likeliest of the candidates.
  std::size_t searching_scans = 0;
  std::optional<Timestamp> found_at;  ///< first pose that is meant
  double found_after_m = 0.0;         ///< driven until then
  std::string final_state;            ///< "sure", "unsure" (several places fit), "nowhere"
  PoseWithCovariance final_pose;
  /// Where the robot may be at the end, with weights, best first.
  std::vector<std::pair<PoseWithCovariance, double>> final_places;
  std::size_t largest_particle_count = 0;
  double mean_particle_count = 0.0;
  double data_s = 0.0;      ///< largest minus smallest stamp
  double distance_m = 0.0;  ///< along the trajectory
  GeoUse geo;
  std::vector<std::string> notes;
};

/// What is known of the start all the same when the pose is not.
struct StartHints {
  /// Near a point, of sigma_m: where it was last seen, or a fix.
  struct Near {
    Point2 p_map;
    double sigma_m = 1.0;
  };
  /// A compass, counter-clockwise from the map's x axis.
  struct Heading {
    double yaw_rad = 0.0;
    double sigma_rad = 0.1;
  };
  /// A rectangle in map axes that it is in.
  struct Zone {
    Point2 low;
    Point2 high;
  };
  std::optional<Near> near;
  std::optional<Heading> heading;
  std::optional<Zone> zone;
};

/// Particle localization of a recording in a prior map.
/// \param T_map_base_init empty = global localization
/// \param hints for global localization
/// \param georeference of the map, by which fixes and headings of the recording count
///                     (AmclParams::gnss); empty = none, they do not
/// Throws InputError for a recording without laser scans or without odometry.
[[nodiscard]] LocalizeResult localize(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const std::shared_ptr<const grid::OccupancyMap>& map,
    const std::optional<Pose2>& T_map_base_init,
    const Config& config,
    const Observers& observers,
    const Progress& progress,
    const StartHints& hints = {},
    const std::optional<io::MapGeoreference>& georeference = {});

}  // namespace vestibule::pipeline
