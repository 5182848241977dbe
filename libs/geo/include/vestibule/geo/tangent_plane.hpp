#pragma once

#include <Eigen/Core>
#include <memory>

#include "vestibule/core/frames.hpp"

namespace GeographicLib {
class LocalCartesian;
}

namespace vestibule::geo {

/// The `map` frame: east-north-up at a datum on the WGS-84 ellipsoid (never UTM).
/// Exact in both directions (GeographicLib::LocalCartesian), any distance.
class TangentPlane {
 public:
  /// \pre |lat| <= 90, |lon| <= 180, all finite; throws ConfigError otherwise
  explicit TangentPlane(const Geodetic& datum);

  [[nodiscard]] const Geodetic& datum() const { return datum_; }
  /// East, north, up [m].
  [[nodiscard]] Eigen::Vector3d toEnu(const Geodetic& position) const;
  [[nodiscard]] Geodetic toGeodetic(const Eigen::Vector3d& enu) const;

 private:
  Geodetic datum_;
  std::shared_ptr<const GeographicLib::LocalCartesian> projection_;
};

}  // namespace vestibule::geo
