#include "vestibule/mapping/known_poses_mapper.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule::mapping {
namespace {

using grid::Cell;

/// What a laser at the pose sees of the inside of a box with walls at x, y = +-half_m.
LaserScan boxScan(const Pose2& T_map_laser, double half_m) {
  LaserScan scan;
  scan.angle_min_rad = -kPi / 2.0;
  scan.angle_step_rad = kPi / 360.0;
  scan.range_max_m = 20.0;
  for (int i = 0; i <= 360; ++i) {
    const double a = T_map_laser.phi + scan.angle(static_cast<std::size_t>(i));
    const double rx = (std::copysign(half_m, std::cos(a)) - T_map_laser.x) / std::cos(a);
    const double ry = (std::copysign(half_m, std::sin(a)) - T_map_laser.y) / std::sin(a);
    scan.ranges_m.push_back(static_cast<float>(std::min(rx, ry)));
  }
  return scan;
}

TEST(KnownPosesMapper, DrawsTheBoxWhereItIs) {
  // GIVEN scans from several poses in a box of 6 m, the laser 0.2 m ahead of the robot's centre
  KnownPosesMapper mapper({});
  const Pose2 T_base_laser{0.2, 0.0, 0.1};
  for (int k = 0; k < 12; ++k) {
    const Pose2 T_map_base{0.3 * std::cos(k), 0.3 * std::sin(k), 0.5 * k};
    LaserScan scan = boxScan(compose(T_map_base, T_base_laser), 3.02);
    scan.T_base_laser = T_base_laser;
    mapper.add(T_map_base, scan);
  }
  const grid::OccupancyMap map = mapper.build();
  // THEN walls are occupied, the inside free, the outside unknown
  int wall = 0;
  int along = 0;
  for (double s = -2.8; s <= 2.8; s += 0.05, ++along) {
    wall += map.at({3.02, s}) == Cell::kOccupied ? 1 : 0;
    wall += map.at({s, -3.02}) == Cell::kOccupied ? 1 : 0;
    EXPECT_EQ(map.at({0.9 * s, -0.7 * s}), Cell::kFree) << "at s = " << s;
    EXPECT_EQ(map.at({3.3, s}), Cell::kUnknown) << "at s = " << s;
  }
  EXPECT_GE(wall, 2 * along * 95 / 100) << "of " << 2 * along;
  // THEN walls are crisp: the cells occupied are hardly more than the outline's
  EXPECT_LE(map.count(Cell::kOccupied), 4.0 * 6.04 / 0.05 * 1.3);
}

TEST(KnownPosesMapper, LeavesBeamsWithoutEchoOut) {
  KnownPosesMapper mapper({});
  LaserScan scan;
  scan.angle_min_rad = -kPi / 2.0;
  scan.angle_step_rad = kPi / 180.0;
  scan.range_max_m = 8.0;
  scan.ranges_m.assign(181, 81.91F);
  mapper.add({}, scan);
  const grid::OccupancyMap map = mapper.build();
  EXPECT_EQ(map.count(Cell::kOccupied), 0U);
  EXPECT_EQ(map.count(Cell::kFree), 0U);
}

TEST(KnownPosesMapper, CutsLongBeams) {
  KnownPosesParams params;
  params.max_range_m = 5.0;
  KnownPosesMapper mapper(params);
  LaserScan scan;
  scan.angle_min_rad = -0.1;
  scan.angle_step_rad = 0.002;
  scan.range_max_m = 80.0;
  scan.ranges_m.assign(101, 9.0F);
  for (int i = 0; i < 5; ++i) mapper.add({}, scan);
  const grid::OccupancyMap map = mapper.build();
  EXPECT_EQ(map.at({4.0, 0.0}), Cell::kFree);
  EXPECT_EQ(map.at({6.0, 0.0}), Cell::kUnknown);
  EXPECT_EQ(map.count(Cell::kOccupied), 0U);
}

}  // namespace
}  // namespace vestibule::mapping
