#include "vestibule/mapping/scan_matcher.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "room.hpp"
#include "vestibule/mapping/drive_path.hpp"

namespace vestibule::mapping {
namespace {

using test::Room;

/// The room's map from a dozen true poses.
PatchMap roomMap(const Room& room) {
  std::vector<ScanNode> nodes;
  RandomStream noise(3, "room map");
  for (int i = 0; i < 24; ++i) {
    ScanNode node;
    node.T_map_base = {2.0 + 0.25 * i, 2.0 + (i % 3) * 0.1, i * 2.1};
    node.scan = room.scanFrom(node.T_map_base, &noise);
    nodes.push_back(node);
  }
  return mapOf(nodes, {});
}

const PosePrior kNothingKnown{{}, Eigen::Matrix3d::Identity() * 1e-9};

TEST(ScanMatcher, RefinesToMillimetres) {
  const Room room;
  const PatchMap map = roomMap(room);
  const ScanMatcher matcher({});
  RandomStream noise(5, "refine");
  double worst_m = 0.0;
  double worst_rad = 0.0;
  for (int i = 0; i < 20; ++i) {
    const Pose2 truth{2.5 + 0.2 * i, 2.2, 0.3 * i};
    const ScanPoints points = matchPoints(room.scanFrom(truth, &noise), {});
    // GIVEN a start 4 cm and 1 degree off
    const Pose2 start = compose(truth, {0.03, -0.026, degToRad(i % 2 == 0 ? 1.0 : -1.0)});
    const Pose2 found = matcher.refine(map, points, start, kNothingKnown).T_map_base;
    worst_m = std::max(worst_m, distance(found, truth));
    worst_rad = std::max(worst_rad, std::abs(angleDiff(found.phi, truth.phi)));
  }
  // 1 cm of noise on some 150 beams leaves about 2 mm; the map has as much.
  EXPECT_LT(worst_m, 0.010);
  EXPECT_LT(worst_rad, degToRad(0.15));
}

TEST(ScanMatcher, SearchFindsAPoseFarFromTheGuess) {
  const Room room;
  const PatchMap map = roomMap(room);
  ScanMatcher matcher({});
  const Pose2 truth{4.0, 2.3, 0.7};
  const ScanPoints points = matchPoints(room.scanFrom(truth), {});
  const PosePrior prior{
      compose(truth, {0.9, -0.7, degToRad(-19.0)}), Eigen::Matrix3d::Identity() * 1e-6};
  const Pose2 found = matcher.search(map, points, prior, 1.2, degToRad(25.0));
  EXPECT_LT(distance(found, truth), 0.08);
  EXPECT_LT(std::abs(angleDiff(found.phi, truth.phi)), degToRad(1.5));
  const Pose2 refined = matcher.refine(map, points, found, kNothingKnown).T_map_base;
  EXPECT_LT(distance(refined, truth), 0.01);
}

TEST(ScanMatcher, SearchKeepsToTheWindow) {
  const Room room;
  const PatchMap map = roomMap(room);
  ScanMatcher matcher({});
  const Pose2 truth{4.0, 2.3, 0.7};
  const ScanPoints points = matchPoints(room.scanFrom(truth), {});
  const PosePrior prior{compose(truth, {1.0, 0.0, 0.0}), Eigen::Matrix3d::Identity() * 1e-6};
  const Pose2 found = matcher.search(map, points, prior, 0.2, degToRad(3.0));
  EXPECT_LE(std::abs(found.x - prior.mean.x), 0.2 + 1e-9);
  EXPECT_LE(std::abs(found.y - prior.mean.y), 0.2 + 1e-9);
  EXPECT_LE(std::abs(angleDiff(found.phi, prior.mean.phi)), degToRad(4.0));
}

TEST(ScanMatcher, ACorridorSaysNothingAboutTheWayAlongIt) {
  // GIVEN a corridor without ends in reach
  Room corridor;
  const auto scanAt = [](const Pose2& laser) {
    LaserScan scan;
    scan.angle_min_rad = -kPi / 2.0;
    scan.angle_step_rad = kPi / 180.0;
    scan.range_max_m = 15.0;
    for (std::size_t i = 0; i <= 180; ++i) {
      const double s = std::sin(laser.phi + scan.angle(i));
      const double range = ((s > 0.0 ? 1.0 : -1.0) - laser.y) / s;
      scan.ranges_m.push_back(static_cast<float>(range));
    }
    return scan;
  };
  std::vector<ScanNode> nodes;
  for (int i = -20; i <= 20; ++i) {
    ScanNode node;
    node.T_map_base = {0.3 * i, 0.0, i % 2 == 0 ? 0.0 : kPi};
    node.scan = scanAt(node.T_map_base);
    nodes.push_back(node);
  }
  const PatchMap map = mapOf(nodes, {});
  // WHEN the odometry puts the robot 3 cm along and 2 cm across the truth
  const Pose2 truth{0.1, 0.1, 0.02};
  const ScanPoints points = matchPoints(scanAt(truth), {});
  PosePrior prior{{0.13, 0.12, 0.03}, Eigen::Matrix3d::Identity() * 400.0};
  const Refinement found = ScanMatcher({}).refine(map, points, prior.mean, prior);
  // THEN across it is right, and along it stays where the odometry says
  EXPECT_NEAR(found.T_map_base.y, truth.y, 0.005);
  EXPECT_NEAR(found.T_map_base.phi, truth.phi, degToRad(0.2));
  EXPECT_NEAR(found.T_map_base.x, prior.mean.x, 0.01);
  EXPECT_LT(found.information(0, 0), 0.05 * found.information(1, 1));
}

TEST(ScanMatcher, FitTellsWallsFromFreeSpaceAndTheUnknown) {
  const Room room;
  const PatchMap map = roomMap(room);
  const ScanMatcher matcher({});
  const Pose2 truth{4.0, 2.3, 0.7};
  const ScanPoints points = matchPoints(room.scanFrom(truth), {});
  const ScanFit right = matcher.fit(map, points, truth);
  const ScanFit off = matcher.fit(map, points, compose(truth, {-0.5, 0.0, 0.0}));
  const ScanFit outside = matcher.fit(map, points, {100.0, 0.0, 0.0});
  EXPECT_GT(right.known_share, 0.95);
  EXPECT_GT(right.log_likelihood, -2.0);
  EXPECT_LT(off.log_likelihood, right.log_likelihood - 10.0);
  EXPECT_EQ(outside.matched_share, 0.0);
  EXPECT_EQ(outside.known_share, 0.0);
  EXPECT_NEAR(
      outside.log_likelihood,
      MatcherParams{}.effective_beams * std::log(MatcherParams{}.z_unknown),
      1e-6);
}

TEST(ScanPoints, WallsHaveNormalsAndAPoleHasNone) {
  Room room;
  room.addPolygon({{6.0, 2.0}, {6.01, 2.0}, {6.01, 2.01}, {6.0, 2.01}});
  const ScanPoints points = matchPoints(room.scanFrom({4.0, 2.0, 0.0}), {});
  std::size_t on_line = 0;
  bool pole = false;
  for (const ScanPoint& p : points.points) {
    on_line += p.surface == Surface::kWall ? 1U : 0U;
    if (std::hypot(p.x - 2.0, p.y) < 0.05) {
      pole = true;
      EXPECT_EQ(p.surface, Surface::kSpot);
    }
    if (p.surface == Surface::kWall) {
      EXPECT_NEAR(std::hypot(p.nx, p.ny), 1.0, 1e-9);
    }
  }
  EXPECT_TRUE(pole);
  EXPECT_GT(on_line, points.points.size() * 8 / 10);
}

}  // namespace
}  // namespace vestibule::mapping
