#include "vestibule/io/trajectory.hpp"

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "byte_stream.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::io {
namespace {

constexpr double kQuaternionTolerance = 0.05;

/// MRPT's yaw-pitch-roll is Rz(yaw) Ry(pitch) Rx(roll).
Eigen::Quaterniond quaternionOf(const Pose3& T) {
  return Eigen::AngleAxisd(T.yaw, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(T.pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(T.roll, Eigen::Vector3d::UnitX());
}

}  // namespace

Trajectory readTum(const std::string& path) {
  LineReader lines(openFile(path));
  Trajectory trajectory;
  std::string_view line;
  std::vector<std::string_view> words;
  while (lines.next(line)) {
    splitWords(line, words);
    if (words.empty() || words[0].front() == '#') continue;
    if (words.size() != 8) {
      throw InputError(
          lines.where() + ": " + std::to_string(words.size()) +
          " columns; a TUM line is 't x y z qx qy qz qw'");
    }
    const auto stamp = parseStamp(words[0]);
    if (!stamp) throw InputError(lines.where() + ": time " + quoted(words[0]) + " is not seconds");
    std::array<double, 7> v{};
    for (std::size_t i = 0; i < v.size(); ++i) {
      if (!parseNumber(words[i + 1], v[i]) || !std::isfinite(v[i])) {
        throw InputError(
            lines.where() + ": column " + std::to_string(i + 2) + " is " + quoted(words[i + 1]) +
            ", not a finite number");
      }
    }
    Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
    if (std::abs(q.norm() - 1.0) > kQuaternionTolerance) {
      throw InputError(
          lines.where() + ": quaternion norm " + std::to_string(q.norm()) +
          "; must be 1 (order qx qy qz qw)");
    }
    q.normalize();
    const Eigen::Matrix3d R = q.toRotationMatrix();
    trajectory.push_back(
        {*stamp,
         Pose3(
             v[0],
             v[1],
             v[2],
             std::atan2(R(1, 0), R(0, 0)),
             std::asin(std::min(1.0, std::max(-1.0, -R(2, 0)))),
             std::atan2(R(2, 1), R(2, 2)))});
  }
  if (trajectory.empty())
    throw InputError(path + ": no poses; a TUM line is 't x y z qx qy qz qw'");
  return trajectory;
}

std::string formatKittiLine(const Pose3& T_map_base) {
  const Eigen::Matrix3d R = quaternionOf(T_map_base).toRotationMatrix();
  const std::array<double, 3> t{T_map_base.x, T_map_base.y, T_map_base.z};
  std::string line;
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 4; ++col) {
      char text[64];
      const double value = col < 3 ? R(row, col) : t[static_cast<std::size_t>(row)];
      std::snprintf(text, sizeof text, "%.9g", value == 0.0 ? 0.0 : value);
      line += (row + col > 0 ? " " : "") + std::string(text);
    }
  }
  return line + "\n";
}

std::string toGeoJson(const std::vector<Geodetic>& positions, const std::string& name) {
  nlohmann::ordered_json feature;
  feature["type"] = "Feature";
  feature["properties"]["name"] = name;
  feature["geometry"]["type"] = "LineString";
  feature["geometry"]["coordinates"] = nlohmann::ordered_json::array();
  for (const Geodetic& p : positions) {
    feature["geometry"]["coordinates"].push_back({p.lon_deg, p.lat_deg, p.height_m});
  }
  nlohmann::ordered_json collection;
  collection["type"] = "FeatureCollection";
  collection["features"] = {feature};
  return collection.dump() + "\n";
}

std::string formatTumLine(const StampedPose& pose) {
  Eigen::Quaterniond q = quaternionOf(pose.T).normalized();
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  const std::array<double, 7> values{pose.T.x, pose.T.y, pose.T.z, q.x(), q.y(), q.z(), q.w()};
  std::string line = formatSeconds(pose.stamp);
  for (const double value : values) {
    char text[64];
    std::snprintf(text, sizeof text, " %.9f", value);
    // "-0.000000000" and "0.000000000" are one number: keep one spelling.
    const bool minus_zero = std::string(text).find_first_not_of(" -0.") == std::string::npos;
    line += minus_zero ? " 0.000000000" : text;
  }
  return line + "\n";
}

}  // namespace vestibule::io
