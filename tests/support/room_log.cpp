#include "room_log.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "vestibule/core/angles.hpp"

namespace vestibule::test {
namespace {

struct Wall {
  Point2 a, b;
};

std::vector<Wall> roomWalls() {
  const std::vector<Point2> outline{
      {0, 0}, {9, 0}, {9, 3}, {7.5, 3}, {7.5, 4.5}, {9, 4.5}, {9, 7}, {0, 7}};
  const std::vector<Point2> pillar{{3.8, 3.2}, {4.6, 3.2}, {4.6, 3.7}, {3.8, 3.7}};
  std::vector<Wall> walls;
  for (const auto& polygon : {outline, pillar}) {
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      walls.push_back({polygon[i], polygon[(i + 1) % polygon.size()]});
    }
  }
  return walls;
}

/// Distance along the ray to the nearest wall [m]; the room is closed, so there is one.
double castRay(const std::vector<Wall>& walls, const Pose2& from, double angle_rad) {
  const double dx = std::cos(from.phi + angle_rad);
  const double dy = std::sin(from.phi + angle_rad);
  double nearest_m = 1e9;
  for (const Wall& w : walls) {
    const double ex = w.b.x - w.a.x;
    const double ey = w.b.y - w.a.y;
    const double det = ex * dy - ey * dx;
    if (std::abs(det) < 1e-12) continue;
    const double ax = w.a.x - from.x;
    const double ay = w.a.y - from.y;
    const double along_ray = (ex * ay - ey * ax) / det;
    const double along_wall = (dx * ay - dy * ax) / det;
    if (along_ray > 0.0 && along_wall >= 0.0 && along_wall <= 1.0) {
      nearest_m = std::min(nearest_m, along_ray);
    }
  }
  return nearest_m;
}

}  // namespace

RoomDrive::RoomDrive() {
  // An ellipse about the pillar, looking along the path.
  constexpr int kScans = 140;
  for (int i = 0; i < kScans; ++i) {
    const double t = -kPi / 2.0 + 2.0 * kPi * i / kScans;
    Pose2 pose;
    pose.x = 4.2 + 2.6 * std::cos(t);
    pose.y = 3.45 + 2.0 * std::sin(t);
    pose.phi = std::atan2(2.0 * std::cos(t), -2.6 * std::sin(t));
    poses.push_back(pose);
    // Every now and then the logger stamped a scan earlier than the one before it.
    const double late_s = i == 50 || i == 90 ? -0.3 : 0.0;
    stamps.push_back(timestampFromSeconds(1000.0 + 0.2 * i + late_s));
  }
}

std::string RoomDrive::carmenLog(bool corrected) const {
  const std::vector<Wall> walls = roomWalls();
  std::string log =
      "# message_name [message contents] ipc_timestamp ipc_hostname logger_timestamp\n";
  Pose2 odometry;
  char text[200];
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (i > 0) {
      Pose2 step = between(poses[i - 1], poses[i]);
      step.x *= 1.02;
      odometry = compose(odometry, step);
    }
    log += "FLASER 181";
    for (int beam = 0; beam <= 180; ++beam) {
      std::snprintf(text, sizeof text, " %.3f", castRay(walls, poses[i], degToRad(beam - 90.0)));
      log += text;
    }
    const Pose2& p = corrected ? poses[i] : odometry;
    std::snprintf(
        text,
        sizeof text,
        " %.6f %.6f %.6f %.6f %.6f %.6f %s robot %.6f\n",
        p.x,
        p.y,
        p.phi,
        p.x,
        p.y,
        p.phi,
        formatSeconds(stamps[i]).c_str(),
        0.2 * static_cast<double>(i));
    log += text;
  }
  return log;
}

}  // namespace vestibule::test
