#pragma once

#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"

namespace vestibule::io {

struct GeodeticPose {
  Timestamp stamp;
  Geodetic position;
  double roll_rad = 0.0;
  double pitch_rad = 0.0;
  double yaw_rad = 0.0;  ///< counter-clockwise from east
};
using GeodeticTrack = std::vector<GeodeticPose>;

/// RFC 7946: one feature with a line string, longitude first.
[[nodiscard]] std::string formatGeoJson(const GeodeticTrack& track, const std::string& name);
/// KML 2.2: one place mark with a line string.
[[nodiscard]] std::string formatKml(const GeodeticTrack& track, const std::string& name);
/// Rows like a TUM file's with the position as latitude, longitude [deg] and height [m].
[[nodiscard]] std::string formatGeodeticCsv(const GeodeticTrack& track);

}  // namespace vestibule::io
