#include "vestibule/geo/tangent_plane.hpp"

#include <GeographicLib/LocalCartesian.hpp>
#include <cmath>

#include "vestibule/core/errors.hpp"

namespace vestibule::geo {

TangentPlane::TangentPlane(const Geodetic& datum) : datum_(datum) {
  if (!(std::abs(datum.lat_deg) <= 90.0) || !(std::abs(datum.lon_deg) <= 180.0) ||
      !std::isfinite(datum.height_m)) {
    throw ConfigError(
        "datum (" + std::to_string(datum.lat_deg) + ", " + std::to_string(datum.lon_deg) + ", " +
        std::to_string(datum.height_m) +
        "): latitude must lie in [-90, 90] and longitude in [-180, 180] degrees");
  }
  projection_ = std::make_shared<const GeographicLib::LocalCartesian>(
      datum.lat_deg, datum.lon_deg, datum.height_m);
}

Eigen::Vector3d TangentPlane::toEnu(const Geodetic& position) const {
  Eigen::Vector3d enu;
  projection_->Forward(
      position.lat_deg, position.lon_deg, position.height_m, enu.x(), enu.y(), enu.z());
  return enu;
}

Geodetic TangentPlane::toGeodetic(const Eigen::Vector3d& enu) const {
  Geodetic position;
  projection_->Reverse(
      enu.x(), enu.y(), enu.z(), position.lat_deg, position.lon_deg, position.height_m);
  return position;
}

}  // namespace vestibule::geo
