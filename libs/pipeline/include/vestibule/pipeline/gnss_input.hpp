#pragma once

#include <Eigen/Core>
#include <optional>

#include "vestibule/ekf/filter.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::pipeline {

/// Antenna position of a fix in the map frame [m]; a fix in local metres is taken as it is.
/// \param plane needed for geodetic fixes only
[[nodiscard]] Eigen::Vector3d antennaInMap(
    const GnssFix& fix, const std::optional<geo::TangentPlane>& plane);

/// Standard deviation per axis [m] as the receiver claims it, or the least of the fix's type.
[[nodiscard]] double claimedSigma(const GnssFix& fix, const ekf::GnssParams& params);

/// Where a fix puts the base of a robot that faces as T_map_base.
[[nodiscard]] Point2 baseInMap(
    const Point2& p_map_antenna, const Pose2& T_map_base, const Point2& p_base_antenna);

/// A fix as the filter takes it.
[[nodiscard]] ekf::MapFix inMap(const GnssFix& fix, const Eigen::Vector3d& p_map_antenna);

/// Whether the filter took a fix in, at full or reduced weight.
[[nodiscard]] bool wasUsed(const ekf::UpdateReport& report);

}  // namespace vestibule::pipeline
