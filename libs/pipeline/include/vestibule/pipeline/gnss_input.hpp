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

/// A fix as the filter takes it.
[[nodiscard]] ekf::MapFix inMap(const GnssFix& fix, const Eigen::Vector3d& p_map_antenna);

/// Whether the filter took a fix in, at full or reduced weight.
[[nodiscard]] bool wasUsed(const ekf::UpdateReport& report);

}  // namespace vestibule::pipeline
