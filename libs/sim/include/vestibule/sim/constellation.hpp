#pragma once

#include <cstdint>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"

namespace vestibule::sim {

/// Where a satellite stands in the sky.
struct SkyPosition {
  double azimuth_rad = 0.0;    ///< counter-clockwise from east
  double elevation_rad = 0.0;  ///< above the horizon
  bool geostationary = false;
};

/// GPS, GLONASS and Galileo as Walker constellations on circular orbits and one geostationary
/// satellite with corrections above the site's meridian. Right in numbers, heights and motion of
/// the sky, not in the almanac of a day. Orbits: IS-GPS-200, ICD GLONASS 5.1, Galileo OS SIS ICD.
class Constellation {
 public:
  /// \param seed turns the constellations against each other and against the site
  Constellation(const Geodetic& datum, std::uint64_t seed);

  /// Every satellite, in a fixed order; those below the horizon have negative elevation.
  [[nodiscard]] std::vector<SkyPosition> at(Timestamp stamp) const;
  [[nodiscard]] std::size_t size() const { return orbits_.size() + 1; }

 private:
  struct Orbit {
    double radius_m;
    double inclination_rad;
    double node_rad;
    double phase_rad;
  };
  std::vector<Orbit> orbits_;
  double lat_rad_;
  double lon_rad_;
};

}  // namespace vestibule::sim
