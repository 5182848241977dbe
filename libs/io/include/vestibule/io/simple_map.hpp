#pragma once

#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::io {

/// One scan of a map and the drive it comes from.
struct MapFrame {
  Pose2 T_map_base;
  LaserScan scan;
  int session = 1;  ///< drives that made the map are numbered from 1
};

/// Writes an MRPT .simplemap (gz). The session is in the sensor label: "session 2".
/// Throws InputError when the file cannot be written.
void saveSimpleMap(const std::string& path, const std::vector<MapFrame>& frames);

/// Frames of a .simplemap with planar scans; other observations are left out, frames without a
/// session are of session 1. Throws InputError for a missing or unreadable file.
[[nodiscard]] std::vector<MapFrame> readSimpleMap(const std::string& path);

}  // namespace vestibule::io
