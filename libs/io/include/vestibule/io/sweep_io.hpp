#pragma once

#include <string>

#include "vestibule/sensors/measurements.hpp"

namespace vestibule::io {

/// Reads a point cloud file of the Point Cloud Library as one sweep: ASCII, binary and compressed
/// binary, fields x, y, z (floats), and `ring` and `t` or `time` [s] where it has them. Points with
/// a coordinate that is not finite are left out.
/// \param T_base_laser where the cloud's origin sits on the robot; the header's VIEWPOINT is not
///   used, since most writers leave it at the identity
/// Throws InputError naming the file, the header line or the point.
[[nodiscard]] LidarSweep readPcd(const std::string& path, const Pose3& T_base_laser);

}  // namespace vestibule::io
