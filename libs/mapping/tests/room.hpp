#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::mapping::test {

/// A closed room of 10 x 8 m with a niche and a wall stub, seen by a laser with 181 beams over 180
/// degrees, 0.2 m ahead of the robot's centre.
class Room {
 public:
  Room() {
    addPolygon({{0, 0}, {10, 0}, {10, 3}, {8.7, 3}, {8.7, 4.4}, {10, 4.4}, {10, 8}, {0, 8}});
    addPolygon({{3.5, 3.5}, {5.2, 3.5}, {5.2, 3.8}, {3.5, 3.8}});
  }
  void addPolygon(const std::vector<Point2>& p) {
    for (std::size_t i = 0; i < p.size(); ++i) walls_.push_back({p[i], p[(i + 1) % p.size()]});
  }

  /// \param noise of the ranges, one sigma 1 cm; null = none
  [[nodiscard]] LaserScan scanFrom(const Pose2& T_map_base, RandomStream* noise = nullptr) const {
    LaserScan scan;
    scan.angle_min_rad = -kPi / 2.0;
    scan.angle_step_rad = kPi / 180.0;
    scan.range_max_m = 20.0;
    scan.T_base_laser = {0.2, 0.0, 0.0};
    const Pose2 laser = compose(T_map_base, scan.T_base_laser);
    for (std::size_t i = 0; i <= 180; ++i) {
      double range = rayLength(laser, laser.phi + scan.angle(i));
      if (noise != nullptr) range += noise->normal(0.0, 0.01);
      scan.ranges_m.push_back(static_cast<float>(range));
    }
    return scan;
  }

 private:
  struct Wall {
    Point2 a, b;
  };
  [[nodiscard]] double rayLength(const Pose2& from, double angle) const {
    const double dx = std::cos(angle);
    const double dy = std::sin(angle);
    double nearest = 1e9;
    for (const Wall& w : walls_) {
      const double ex = w.b.x - w.a.x;
      const double ey = w.b.y - w.a.y;
      const double det = ex * dy - ey * dx;
      if (std::abs(det) < 1e-12) continue;
      const double ax = w.a.x - from.x;
      const double ay = w.a.y - from.y;
      const double along_ray = (ex * ay - ey * ax) / det;
      const double along_wall = (dx * ay - dy * ax) / det;
      if (along_ray > 0.0 && along_wall >= 0.0 && along_wall <= 1.0 && along_ray < nearest) {
        nearest = along_ray;
      }
    }
    return nearest;
  }
  std::vector<Wall> walls_;
};

/// Two rounds about the wall stub: true poses and odometry that over-counts distance by 3 % and
/// turns by 5 %.
struct RoomDrive {
  std::vector<Pose2> T_map_base;
  std::vector<Pose2> T_odom_base;
  std::vector<LaserScan> scans;

  /// \param slip_at the odometry jumps by a metre and 20 degrees at this scan
  explicit RoomDrive(std::size_t count = 120, std::size_t slip_at = 0) {
    const Room room;
    RandomStream noise(7, "room drive");
    for (std::size_t i = 0; i < count; ++i) {
      const double t = -kPi / 2.0 + 4.0 * kPi * static_cast<double>(i) / 120.0;
      const Pose2 pose{
          4.4 + 2.9 * std::cos(t),
          3.7 + 2.2 * std::sin(t),
          std::atan2(2.2 * std::cos(t), -2.9 * std::sin(t))};
      Pose2 odometry;
      if (i > 0) {
        Pose2 step = between(T_map_base.back(), pose);
        step = {1.03 * step.x, 1.03 * step.y, 1.05 * step.phi};
        if (i == slip_at) step = compose(step, {0.8, -0.6, degToRad(20.0)});
        odometry = compose(T_odom_base.back(), step);
      }
      T_map_base.push_back(pose);
      T_odom_base.push_back(odometry);
      LaserScan scan = room.scanFrom(pose, &noise);
      scan.stamp = {static_cast<std::int64_t>(i) * 200'000'000};
      scans.push_back(scan);
    }
  }
};

}  // namespace vestibule::mapping::test
