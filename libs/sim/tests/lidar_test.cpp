#include "vestibule/sim/lidar.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "moments.hpp"
#include "vestibule/sim/world.hpp"

namespace vestibule::sim {
namespace {

EchoParams perfect() {
  EchoParams echo;
  echo.sigma_m = echo.drop_out = echo.outliers = echo.mixed_share = echo.grazing_rad = 0.0;
  return echo;
}

World room(Material material = Material::kSolid) {
  World world;
  world.walls.push_back({"", {{-5, -5}, {5, -5}, {5, 5}, {-5, 5}}, true, 2.5, 0.0, material});
  return world;
}

/// Range of an analytic square room of 10 m.
double roomRange(const Point2& p, double angle_rad) {
  const double c = std::cos(angle_rad);
  const double s = std::sin(angle_rad);
  return std::min(((c > 0 ? 5.0 : -5.0) - p.x) / c, ((s > 0 ? 5.0 : -5.0) - p.y) / s);
}

LaserScan scanAt(
    const WorldGeometry& geometry,
    const LidarParams& params,
    const Pose3& T_map_base,
    std::uint64_t index = 0) {
  return simulateScan(
      geometry, {}, params, [&](double) { return T_map_base; }, {}, {}, 3, index);
}

TEST(Lidar, HasTheStatedNoiseInAnAnalyticRoom) {
  const WorldGeometry geometry(room());
  LidarParams params;
  params.echo.mixed_share = 0.0;
  const Pose3 T{0.4, -0.3, 0.0, 0.7, 0.0, 0.0};
  Moments error;
  int missing = 0;
  int short_echo = 0;
  int total = 0;
  for (std::uint64_t k = 0; k < 200; ++k) {
    const LaserScan scan = scanAt(geometry, params, T, k);
    ASSERT_EQ(scan.ranges_m.size(), 361U);
    for (std::size_t i = 0; i < scan.ranges_m.size(); ++i, ++total) {
      const double truth_m = roomRange({0.4, -0.3}, 0.7 + scan.angle(i));
      if (!scan.valid(i)) {
        ++missing;
      } else if (std::abs(scan.ranges_m[i] - truth_m) > 0.15) {
        ++short_echo;
        EXPECT_LT(scan.ranges_m[i], truth_m);
      } else {
        error.add(scan.ranges_m[i] - truth_m);
      }
    }
  }
  // 72200 beams: 5 sigma of the mean is 0.0004 m, of sigma 1.3 %, of a 0.5 % share 0.13 %. About
  // 5 % of the short echoes end too near the wall to be told from noise, and some under 0.1 m.
  EXPECT_NEAR(error.mean(), 0.0, 4e-4);
  EXPECT_NEAR(error.sigma(), 0.02, 0.02 * 0.02);
  EXPECT_NEAR(static_cast<double>(missing) / total, 0.005, 0.0013);
  EXPECT_NEAR(static_cast<double>(short_echo) / total, 0.005, 0.0014);
}

TEST(Lidar, BeamsAreMeasuredOneAfterTheOther) {
  const WorldGeometry geometry(room());
  LidarParams params;
  params.echo = perfect();
  params.sweep_s = 0.1;
  params.rate_hz = 10.0;
  // GIVEN a robot that turns at 1 rad/s about its laser
  const auto turning = [](double share) { return Pose3{0.4, -0.3, 0, 0.1 * share, 0, 0}; };
  const LaserScan scan = simulateScan(geometry, {}, params, turning, {}, {}, 1, 0);
  double worst_m = 0.0;
  double skew_m = 0.0;
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const double turned_rad = 1.0 * scan.time_increment_s * static_cast<double>(i);
    const auto range = static_cast<double>(scan.ranges_m[i]);
    worst_m =
        std::max(worst_m, std::abs(range - roomRange({0.4, -0.3}, scan.angle(i) + turned_rad)));
    skew_m = std::max(skew_m, std::abs(range - roomRange({0.4, -0.3}, scan.angle(i))));
  }
  EXPECT_LT(worst_m, 1e-5) << "each beam belongs to the pose of its own time";
  EXPECT_GT(skew_m, 0.2) << "a scan taken as one instant is bent";
}

TEST(Lidar, LightGoesThroughGlassAndDiesOnDarkWalls) {
  LidarParams params;
  params.echo = perfect();
  World behind_glass = room(Material::kGlass);
  behind_glass.walls.push_back({"", {{-9, -9}, {9, -9}, {9, 9}, {-9, 9}}, true});
  const WorldGeometry glass(behind_glass);
  const WorldGeometry dark(room(Material::kDark));
  const WorldGeometry leaves(room(Material::kFoliage));
  int through = 0;
  int oblique = 0;
  int lost = 0;
  int beams = 0;
  Moments depth;
  const Pose3 turned{0, 0, 0, 0.013, 0, 0};  // no beam exactly along a wall's normal
  for (std::uint64_t k = 0; k < 20; ++k) {
    const LaserScan a = scanAt(glass, params, turned, k);
    const LaserScan b = scanAt(dark, params, turned, k);
    const LaserScan c = scanAt(leaves, params, turned, k);
    for (std::size_t i = 0; i < a.ranges_m.size(); ++i, ++beams) {
      const double truth_m = roomRange({0, 0}, turned.yaw + a.angle(i));
      const bool passed = a.ranges_m[i] > truth_m + 0.5;
      const bool head_on = 5.0 / truth_m > std::cos(0.17);
      if (head_on) {
        EXPECT_FALSE(passed) << "beam " << i;
      }
      if (!head_on) {
        ++oblique;
        through += passed ? 1 : 0;
      }
      lost += b.valid(i) ? 0 : 1;
      ASSERT_TRUE(c.valid(i)) << "beam " << i << " at " << c.angle(i);
      depth.add(c.ranges_m[i] - truth_m);
    }
  }
  // 7220 beams: 5 sigma of a share of 0.8 is 0.026, of 0.5 is 0.03.
  EXPECT_NEAR(static_cast<double>(through) / oblique, 0.8, 0.027);
  EXPECT_NEAR(static_cast<double>(lost) / beams, 0.5, 0.03);
  EXPECT_GT(depth.mean(), 0.10);
  EXPECT_LT(depth.mean(), 0.15);
}

TEST(Lidar, SeesBothSidesAtAnEdge) {
  World world = room();
  world.boxes.push_back({"", {2.0, 0.0}, 0.4, 0.4, 0.0, 2.0});
  const WorldGeometry geometry(world);
  LidarParams params;
  params.echo = perfect();
  params.beams = 10801;
  params.echo.mixed_share = 1.0;
  const LaserScan scan = scanAt(geometry, params, {});
  int between = 0;
  for (const float range : scan.ranges_m) between += range > 2.3F && range < 4.9F ? 1 : 0;
  // Two edges, each 0.2 deg wide at 0.025 deg per beam: eight beams, one in nine beyond the limits.
  EXPECT_GE(between, 9);
  EXPECT_LE(between, 16);
}

TEST(Lidar, TiltsWithTheRobot) {
  const WorldGeometry geometry(std::vector<Segment>{});
  LidarParams params;
  params.echo = perfect();
  params.height_m = 0.4;
  // Nose down by 0.1 rad: the forward beam meets the ground 0.4 / sin(0.1) away.
  const LaserScan scan = scanAt(geometry, params, {0, 0, 0, 0.3, 0.1, 0});
  EXPECT_NEAR(static_cast<double>(scan.ranges_m[180]), 0.4 * std::cos(0.1) / std::sin(0.1), 1e-4);
  EXPECT_FALSE(scan.valid(0)) << "the beam to the rear right goes up";
}

TEST(Lidar, PeopleHideTheirShareOfTheView) {
  const WorldGeometry geometry(room());
  LidarParams params;
  params.echo = perfect();
  params.occlusion = 0.3;
  double hidden = 0.0;
  double beams = 0.0;
  for (std::uint64_t k = 0; k < 1000; k += 10) {
    for (const float range : scanAt(geometry, params, {}, k).ranges_m) {
      hidden += range < 2.6F ? 1.0 : 0.0;
      beams += 1.0;
    }
    EXPECT_EQ(
        scanAt(geometry, params, {}, k).ranges_m, scanAt(geometry, params, {}, k + 1).ranges_m)
        << "people stay for a while";
  }
  // 100 draws of 28 sectors: 5 sigma = 0.043.
  EXPECT_NEAR(hidden / beams, 0.3, 0.043);
}

TEST(RingLidar, SeesWallsAndGroundInThreeDimensions) {
  const WorldGeometry geometry(room());
  RingLidarParams params;
  params.echo = perfect();
  params.azimuths = 90;
  const LidarSweep sweep = simulateSweep(
      geometry, {}, params, [](double) { return Pose3{}; }, Timestamp{5}, 1, 0);
  EXPECT_EQ(sweep.stamp, Timestamp{5});
  int ground = 0;
  for (const LidarSweep::Point& point : sweep.points) {
    const Eigen::Vector3d p =
        point.p_laser.cast<double>() + Eigen::Vector3d(0, 0, sweep.T_base_laser.z);
    const double wall_m = 5.0 - std::max(std::abs(p.x()), std::abs(p.y()));
    EXPECT_TRUE(std::abs(wall_m) < 1e-4 || std::abs(p.z()) < 1e-4) << p.transpose();
    ground += std::abs(p.z()) < 1e-4 ? 1 : 0;
    if (point.ring >= 8) {
      EXPECT_GT(point.p_laser.z(), 0.0F);
    }
  }
  EXPECT_GT(sweep.points.size(), 90U * 15U) << "the highest ring leaves over the corners";
  EXPECT_GT(ground, 90 * 2);
}

}  // namespace
}  // namespace vestibule::sim
