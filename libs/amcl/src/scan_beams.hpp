#pragma once

#include <Eigen/Core>
#include <vector>

#include "vestibule/amcl/params.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::amcl {

/// A scan's beams as the robot saw them at the scan's stamp: the motion during the sweep is taken
/// out. Beams without an echo, or longer than max_range_m, are left out.
///
/// \param twist_base body speed x, y [m/s], yaw [rad/s]
[[nodiscard]] std::vector<Point2> beamEnds(
    const LaserScan& scan, double max_range_m, const Eigen::Vector3d& twist_base);

/// At most max_beams of the ends, spread along the contour: neighbours at least min_spacing_m
/// apart.
[[nodiscard]] std::vector<Point2> spreadAlongContour(
    const std::vector<Point2>& ends, double min_spacing_m, int max_beams);

}  // namespace vestibule::amcl
