#pragma once

#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"

namespace vestibule::io {

struct StampedPose {
  Timestamp stamp;
  Pose3 T;  ///< T_map_base unless the file says otherwise; MRPT yaw-pitch-roll [rad]
};
using Trajectory = std::vector<StampedPose>;

/// Reads a TUM file: `t x y z qx qy qz qw` per line, '#' comments. Lines keep their order.
/// Throws InputError naming file:line for a missing or empty file, a wrong column count, a number
/// that is none, or a quaternion whose norm is not near 1.
[[nodiscard]] Trajectory readTum(const std::string& path);

/// One TUM line with its newline: nine-digit exact stamp, nine decimals, unit quaternion, qw >= 0.
[[nodiscard]] std::string formatTumLine(const StampedPose& pose);

/// One line of a KITTI pose file with its newline: the upper three rows of T_map_base. No stamp.
[[nodiscard]] std::string formatKittiLine(const Pose3& T_map_base);

/// A trajectory as a GeoJSON LineString of longitude, latitude and height.
[[nodiscard]] std::string toGeoJson(
    const std::vector<Geodetic>& positions, const std::string& name);

}  // namespace vestibule::io
