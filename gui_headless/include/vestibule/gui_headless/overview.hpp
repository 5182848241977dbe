#pragma once

#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/gui_headless/run_recorder.hpp"
#include "vestibule/gui_headless/scene.hpp"

namespace vestibule::gui_headless {

struct OverviewStyle {
  int width_px = 1600;
  std::string title;  ///< printed above the map; empty = no header (the report has its own)
  bool particles = true;
  bool ellipses = true;  ///< 95 % of the position covariance, at intervals
  /// In the legend, where path and reference are something else; empty = modes and reference.
  std::string path_words;
  std::string reference_words;
};

/// A map of the run, north up: prior map, buildings and doors, raw fixes, particle snapshots,
/// covariance ellipses, trajectory coloured by mode, reference, waypoints, scale bar, legend.
/// Fits itself to everything but the raw fixes (one bad fix must not shrink the rest).
/// When the scene has no reference the recorded truth stands in.
/// \return PNG bytes; the same input gives the same bytes
[[nodiscard]] std::string renderOverview(
    const RunRecorder& run, const Scene& scene, const OverviewStyle& style = {});

/// What the robot "sees" around itself; stands in for a camera in the mission task `photo`.
struct PhotoView {
  Pose2 T_map_base;
  std::vector<Point2> p_base_scan;  ///< end points of the lidar beams, see endPointsInBase()
  Timestamp stamp;
  std::string waypoint;   ///< for the caption
  double radius_m = 8.0;  ///< half the side of the picture
  int size_px = 900;
  double robot_half_length_m = 0.495;
  double robot_half_width_m = 0.335;
};

/// Top view around the robot, north up, with a caption. \return PNG bytes
[[nodiscard]] std::string renderPhoto(const PhotoView& view, const Scene& scene);

/// Writes beside `path` first and renames, so that no half-written file carries the final name.
/// Throws InputError when the folder cannot be written.
void writeFile(const std::string& path, const std::string& bytes);

}  // namespace vestibule::gui_headless
