#include "vestibule/amcl/map_localizers.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "matchers.hpp"
#include "room_map.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/grid/ray_caster.hpp"

namespace vestibule::amcl {
namespace {

std::shared_ptr<const grid::OccupancyMap> room(double w, double h, const Pose2& T_map_grid) {
  return std::make_shared<const grid::OccupancyMap>(roomMap(w, h, T_map_grid));
}

struct Robot {
  const grid::RayCaster* rays = nullptr;
  Pose2 truth;
  double walls_nearer_m = 0.0;  // than the middle of their cells
  double t_s = 0.0;
  RandomStream rng{7, "robot"};

  void step(MapLocalizers& localizers) {
    const Eigen::Vector3d twist(0.1, 0.0, 0.03);
    truth = compose(truth, expSe2(twist));
    t_s += 0.2;
    WheelOdometry odometry;
    odometry.stamp = timestampFromSeconds(t_s);
    odometry.dt_s = 0.2;
    odometry.T_previous_now = expSe2(1.02 * twist);
    localizers.process(odometry);
    localizers.process(scan());
  }

  LaserScan scan() {
    LaserScan scan;
    scan.stamp = timestampFromSeconds(t_s);
    scan.angle_min_rad = -0.75 * kPi;
    scan.angle_step_rad = degToRad(1.5);
    scan.range_min_m = 0.05;
    scan.range_max_m = 15.0;
    for (int i = 0; i <= 180; ++i) {
      const double yaw = truth.phi + scan.angle(static_cast<std::size_t>(i));
      scan.ranges_m.push_back(static_cast<float>(
          rays->range({truth.x, truth.y}, yaw, 15.0) - walls_nearer_m + rng.normal(0.0, 0.01)));
    }
    return scan;
  }
};

PoseWithCovariance about(const Pose2& T, double sigma_m, double sigma_rad) {
  return {
      T, Eigen::Vector3d(sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad).asDiagonal()};
}

struct TwoMaps {
  std::shared_ptr<const grid::OccupancyMap> hall = room(12.0, 8.0, {0.0, 0.0, 0.3});
  std::shared_ptr<const grid::OccupancyMap> shed = room(9.0, 10.0, {40.0, -5.0, -0.4});
  grid::RayCaster hall_rays{*hall};
  grid::RayCaster shed_rays{*shed};
  MapLocalizers localizers{AmclParams{}, 1};
  TwoMaps() {
    localizers.load("hall", hall);
    localizers.load("shed", shed);
  }
};

TEST(MapLocalizers, HandsOverToTheMapAroundTheSeedAndBack) {
  TwoMaps site;
  EXPECT_FALSE(site.localizers.atWork());
  EXPECT_FALSE(site.localizers.pose());
  Robot robot;
  for (const bool in_hall : {true, false, true}) {
    // GIVEN a guess that is 1.5 m and 15 degrees off, as it may come from GNSS
    robot.rays = in_hall ? &site.hall_rays : &site.shed_rays;
    robot.truth = compose((in_hall ? site.hall : site.shed)->T_map_grid(), Pose2{2.5, 2.0, 0.2});
    ASSERT_TRUE(site.localizers.seed(
        about(compose(robot.truth, Pose2{1.2, -0.9, degToRad(15.0)}), 1.0, degToRad(10.0))));
    EXPECT_EQ(site.localizers.atWork(), in_hall ? "hall" : "shed");
    EXPECT_FALSE(site.localizers.pose()) << "before the first scan";
    // WHEN it drives THEN it is tracked at once
    robot.step(site.localizers);
    EXPECT_THAT(site.localizers.pose()->mean, poseNear(robot.truth, 0.15, degToRad(3.0)));
    for (int i = 0; i < 10; ++i) robot.step(site.localizers);
    EXPECT_THAT(site.localizers.pose()->mean, poseNear(robot.truth, 0.05, degToRad(1.0)));
  }
  site.localizers.rest();
  EXPECT_FALSE(site.localizers.pose());
}

TEST(MapLocalizers, FindsWhatAFewParticlesAroundTheSeedWouldMiss) {
  // GIVEN few particles and a wide seed
  TwoMaps site;
  AmclParams params;
  params.kld.min_particles = 60;
  params.kld.max_particles = 60;
  Robot robot;
  int plain = 0;
  int searched = 0;
  constexpr int kTries = 10;
  for (int i = 0; i < kTries; ++i) {
    const Pose2 truth = compose(site.hall->T_map_grid(), Pose2{2.0 + 0.3 * i, 5.0, 0.4 * i});
    RandomStream rng(3, "seed", static_cast<std::uint64_t>(i));
    const PoseWithCovariance seed = about(
        {truth.x + rng.normal(0.0, 2.0),
         truth.y + rng.normal(0.0, 2.0),
         truth.phi + rng.normal(0.0, 0.4)},
        2.0,
        0.4);
    const auto isRight = [&](const Pose2& T) {
      return distance(T, robot.truth) < 0.1 && std::abs(angleDiff(T.phi, robot.truth.phi)) < 0.05;
    };
    robot.rays = &site.hall_rays;
    robot.truth = truth;
    MapLocalizers localizers(params, 1);
    localizers.load("hall", site.hall);
    ASSERT_TRUE(localizers.seed(seed));
    const LaserScan scan = robot.scan();
    localizers.process(scan);
    if (isRight(localizers.pose()->mean)) ++searched;
    ParticleLocalizer alone(params, site.hall, 1);
    alone.initialise(seed);
    alone.process(scan);
    if (isRight(alone.pose().mean)) ++plain;
  }
  // THEN the search about it has found the place with the first scan
  EXPECT_GE(searched, 9);
  EXPECT_LE(plain, 3);
}

TEST(MapLocalizers, MapsComeAndGoWhileTheRobotDrives) {
  TwoMaps site;
  EXPECT_THAT(site.localizers.names(), testing::ElementsAre("hall", "shed"));
  Robot robot;
  robot.rays = &site.shed_rays;
  robot.truth = compose(site.shed->T_map_grid(), Pose2{2.5, 2.0, 0.2});
  const auto seed = about(robot.truth, 0.3, 0.1);
  ASSERT_TRUE(site.localizers.seed(seed));
  for (int i = 0; i < 3; ++i) robot.step(site.localizers);
  // A map that is not at work goes: nothing changes for the one that is.
  site.localizers.unload("hall");
  site.localizers.unload("no such map");
  EXPECT_EQ(site.localizers.atWork(), "shed");
  robot.step(site.localizers);
  EXPECT_THAT(site.localizers.pose()->mean, poseNear(robot.truth, 0.05, degToRad(1.0)));
  // The one at work goes: no pose any more, and data passes by.
  site.localizers.unload("shed");
  EXPECT_FALSE(site.localizers.atWork());
  robot.step(site.localizers);
  EXPECT_FALSE(site.localizers.pose());
  EXPECT_FALSE(site.localizers.seed(seed));
  // It comes back.
  site.localizers.load("shed", site.shed);
  ASSERT_TRUE(site.localizers.seed(about(robot.truth, 0.3, 0.1)));
  for (int i = 0; i < 3; ++i) robot.step(site.localizers);
  EXPECT_THAT(site.localizers.pose()->mean, poseNear(robot.truth, 0.05, degToRad(1.0)));
}

TEST(MapLocalizers, WhatWasLearntOfAMapOutlivesItsMemory) {
  // GIVEN a robot that has driven where walls stand 4 cm before the middle of their cells, and is
  // outside now
  const auto drive = [](MapLocalizers& localizers, const TwoMaps& site, Robot& robot, int steps) {
    robot.rays = &site.hall_rays;
    robot.walls_nearer_m = 0.04;
    robot.truth = compose(site.hall->T_map_grid(), Pose2{2.5, 2.0, 0.2});
    EXPECT_TRUE(localizers.seed(about(robot.truth, 0.3, 0.1)));
    for (int i = 0; i < steps; ++i) robot.step(localizers);
    const Pose2 end = localizers.pose()->mean;
    localizers.rest();
    return end;
  };
  TwoMaps kept;
  TwoMaps unloaded;
  Robot before;
  (void)drive(kept.localizers, kept, before, 40);
  before = Robot{};
  (void)drive(unloaded.localizers, unloaded, before, 40);
  // WHEN the map leaves the memory meanwhile
  std::weak_ptr<const grid::OccupancyMap> memory = unloaded.hall;
  unloaded.localizers.unload("hall");
  unloaded.hall.reset();
  EXPECT_TRUE(memory.expired()) << "particles and search let go of it, too";
  unloaded.hall = room(12.0, 8.0, {0.0, 0.0, 0.3});
  unloaded.localizers.load("hall", unloaded.hall);
  TwoMaps never_there;
  // THEN the next visit begins as if it had stayed, and not as in a map that is new
  const auto visit = [&](TwoMaps& site) {
    Robot robot = before;
    return drive(site.localizers, site, robot, 3);
  };
  const Pose2 expected = visit(kept);
  EXPECT_THAT(visit(unloaded), poseNear(expected, 1e-6, 1e-6));
  EXPECT_THAT(visit(never_there), testing::Not(poseNear(expected, 1e-3, 1e-6)));
}

}  // namespace
}  // namespace vestibule::amcl
