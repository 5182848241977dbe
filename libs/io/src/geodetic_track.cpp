#include "vestibule/io/geodetic_track.hpp"

#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "vestibule/io/trajectory.hpp"

namespace vestibule::io {
namespace {

/// Nine decimals of a degree are a tenth of a millimetre.
std::string degrees(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.9f", value);
  return text.data();
}

std::string metres(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.3f", value);
  return text.data();
}

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '&') {
      result += "&amp;";
    } else if (c == '<') {
      result += "&lt;";
    } else if (c == '>') {
      result += "&gt;";
    } else {
      result += c;
    }
  }
  return result;
}

}  // namespace

std::string formatGeoJson(const GeodeticTrack& track, const std::string& name) {
  std::string text =
      R"({"type":"FeatureCollection","features":[{"type":"Feature","properties":{"name":)" +
      nlohmann::json(name).dump() + R"(},"geometry":{"type":"LineString","coordinates":[)";
  bool first = true;
  for (const GeodeticPose& p : track) {
    text += std::string(first ? "" : ",") + "\n[" + degrees(p.position.lon_deg) + "," +
            degrees(p.position.lat_deg) + "," + metres(p.position.height_m) + "]";
    first = false;
  }
  return text + "\n]}}]}\n";
}

std::string formatKml(const GeodeticTrack& track, const std::string& name) {
  std::string text =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<kml xmlns=\"http://www.opengis.net/kml/2.2\"><Document><Placemark><name>" +
      escaped(name) + "</name><LineString><tessellate>1</tessellate><coordinates>\n";
  for (const GeodeticPose& p : track) {
    text += degrees(p.position.lon_deg) + "," + degrees(p.position.lat_deg) + "," +
            metres(p.position.height_m) + "\n";
  }
  return text + "</coordinates></LineString></Placemark></Document></kml>\n";
}

std::string formatGeodeticCsv(const GeodeticTrack& track) {
  std::string text = "stamp_s,lat_deg,lon_deg,height_m,qx,qy,qz,qw\n";
  for (const GeodeticPose& p : track) {
    Pose3 attitude;
    attitude.yaw = p.yaw_rad;
    attitude.pitch = p.pitch_rad;
    attitude.roll = p.roll_rad;
    // The quaternion as the TUM line writes it: the last four of its eight columns.
    std::string line = formatTumLine({p.stamp, attitude});
    std::size_t at = 0;
    for (int column = 0; column < 4; ++column) at = line.find(' ', at) + 1;
    std::string quaternion = line.substr(at);
    for (char& c : quaternion) {
      if (c == ' ') c = ',';
    }
    text += formatSeconds(p.stamp) + "," + degrees(p.position.lat_deg) + "," +
            degrees(p.position.lon_deg) + "," + metres(p.position.height_m) + "," + quaternion;
  }
  return text;
}

}  // namespace vestibule::io
