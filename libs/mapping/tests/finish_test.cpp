#include "vestibule/mapping/finish.hpp"

#include <gmock/gmock.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "../src/contour.hpp"
#include "matchers.hpp"
#include "wall_world.hpp"

namespace vestibule::mapping {
namespace {

Contour contourAt(const Pose2& T, std::uint64_t index) {
  RandomStream random(3, "contour", index);
  return Contour(WallWorld::ring().scan(T, {}, random), 25.0);
}

TEST(Contour, NormalsFaceTheLaser) {
  const Contour contour = contourAt({5.0, 1.0, 0.0}, 0);
  ASSERT_GT(contour.sampleCount(), 50U);
  int lines = 0;
  contour.forSamples([&](const ContourPoint& p) {
    if (!p.onLine()) return;
    ++lines;
    EXPECT_LT(p.nx() * p.x + p.ny() * p.y, 0.0);
    EXPECT_NEAR(std::hypot(p.nx(), p.ny()), 1.0, 5e-5);
  });
  EXPECT_GT(lines, 50);
}

TEST(Contour, GaussNewtonFindsTheOffset) {
  const Pose2 T_a{18.6, 1.2, 1.0};
  const Pose2 T_b{18.9, 1.0, 0.8};
  const Contour a = contourAt(T_a, 1);
  const Contour b = contourAt(T_b, 2);
  Pose2 T = between(T_a, T_b);
  T.x += 0.02;
  T.phi += 0.01;
  AlignmentParams params;
  params.effective_points = 1e9;
  for (int i = 0; i < 20; ++i) {
    const Quadratic q = pointToLine(a, b, T, params);
    ASSERT_GT(q.pairs, 100);
    const Eigen::Vector3d step = -q.H.ldlt().solve(q.g);
    T.x += step.x();
    T.y += step.y();
    T.phi += step.z();
  }
  EXPECT_THAT(T, poseNear(between(T_a, T_b), 0.01, 0.004));
  EXPECT_LT(pointToLine(a, b, T, params).g.norm(), 1.0);
}

TEST(Contour, SeesThroughWhatIsNotThere) {
  const Pose2 T{5.0, 1.0, 0.0};
  const Contour contour = contourAt(T, 0);
  const auto in_the_corridor = contour.look({6.0, 0.0}, 0.15);
  EXPECT_TRUE(in_the_corridor.seen_through);
  const auto on_the_wall = contour.look({2.0, 1.0}, 0.15);
  EXPECT_FALSE(on_the_wall.seen_through);
  EXPECT_NE(on_the_wall.nearest, nullptr);
  const auto behind_the_wall = contour.look({2.0, 3.0}, 0.15);
  EXPECT_FALSE(behind_the_wall.seen_through);
  EXPECT_EQ(behind_the_wall.nearest, nullptr);
}

TEST(Contour, ScansOfOnePlaceAgreeAndOfTwoDoNot) {
  const Pose2 T_a{18.6, 1.2, 1.0};
  const Pose2 T_b{18.9, 1.0, 0.8};
  const Overlap right = overlap(contourAt(T_a, 1), contourAt(T_b, 2), between(T_a, T_b), 0.15);
  EXPECT_GT(right.agreement(), 0.95);
  EXPECT_GT(right.matchedShare(), 0.6);
  const Overlap wrong = overlap(
      contourAt(T_a, 1), contourAt(T_b, 2), compose(between(T_a, T_b), {0.8, 0.8, 0.5}), 0.15);
  EXPECT_LT(wrong.agreement(), 0.8);
}

TEST(Track, FollowsTheScansThroughSlips) {
  // GIVEN one round with two slips of 1 m and 20 deg
  const RingDrive drive(1.0, 1.0, 11);
  ASSERT_GT(drive.worst(drive.nodes), 3.0);
  const TrackResult result = trackScans(drive.nodes, {}, 1);
  EXPECT_LT(drive.worst(result.nodes), 0.5);
  EXPECT_GE(result.slips, 2U);
}

/// The truth, off by 2 cm and half a degree at random; the first pose is right.
std::vector<ScanNode> jittered(const RingDrive& drive) {
  RandomStream random(4, "jitter");
  std::vector<ScanNode> nodes = drive.nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    nodes[i].T_map_base = drive.truth[i];
    if (i == 0) continue;
    nodes[i].T_map_base = compose(
        drive.truth[i],
        {random.normal(0.0, 0.02), random.normal(0.0, 0.02), random.normal(0.0, 0.008)});
  }
  return nodes;
}

TEST(Smooth, TakesTheJitterOutOfUsedScansAndPlacesTheOthers) {
  const RingDrive drive(1.25, 0.0, 7);
  const std::vector<ScanNode> before = jittered(drive);
  std::vector<std::size_t> used;
  for (std::size_t i = 0; i < before.size(); i += 2) used.push_back(i);
  std::vector<ScanNode> nodes = before;
  smoothDrive(nodes, used, {}, {}, {});
  EXPECT_LT(drive.rmse(nodes), 0.5 * drive.rmse(before));
  // From scan to scan it is right to millimetres.
  double squares = 0.0;
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    const Pose2 error = between(
        between(drive.truth[i - 1], drive.truth[i]),
        between(nodes[i - 1].T_map_base, nodes[i].T_map_base));
    squares += error.x * error.x + error.y * error.y;
  }
  EXPECT_LT(std::sqrt(squares / static_cast<double>(nodes.size())), 0.012);
  // Without iterations all stays.
  std::vector<ScanNode> same = before;
  smoothDrive(same, used, {0, 3}, {}, {});
  EXPECT_EQ(distance(same.back().T_map_base, before.back().T_map_base), 0.0);
}

TEST(Finish, AJumpAlongACorridorIsNotTakenForWhatTheScansSay) {
  // GIVEN an estimate that loses 1.5 m in a corridor and finds it again in the next one: wheels
  // slipped the first time, which the odometry tells, and the map pulled the path back the second
  RingDrive drive(1.5, 0.0, 12);
  const auto at = [&](double x, double y) {
    std::size_t best = 0;
    for (std::size_t i = 0; i < drive.truth.size(); ++i) {
      if (distance(drive.truth[i], {x, y, 0.0}) < distance(drive.truth[best], {x, y, 0.0}))
        best = i;
    }
    return best;
  };
  const std::size_t lost = at(10.0, 1.0);
  const std::size_t found = at(9.0, 13.0);
  ASSERT_LT(lost, found);
  const Pose2 slip{1.0, 0.0, degToRad(20.0)};
  std::vector<ScanNode> nodes = drive.nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    nodes[i].T_map_base = drive.truth[i];
    if (i >= lost) {
      nodes[i].T_odom_base = compose(
          compose(drive.nodes[lost].T_odom_base, slip),
          between(drive.nodes[lost].T_odom_base, drive.nodes[i].T_odom_base));
    }
    if (i >= lost && i < found) nodes[i].T_map_base.x += 1.5;
  }
  const FinishResult result = finishMap(nodes, {}, {});
  EXPECT_GT(drive.rmse(nodes), 0.5);
  EXPECT_LT(drive.rmse(result.nodes), 0.15);
}

TEST(Finish, ClosesTheRingAndRefinesIt) {
  // GIVEN two and a half rounds
  const RingDrive drive(2.5, 0.0, 5);
  const TrackResult tracked = trackScans(drive.nodes, {}, 1);
  const FinishResult result = finishMap(tracked.nodes, {}, {});
  EXPECT_GE(result.count(ClosureVerdict::kAccepted), 8U);
  EXPECT_LT(result.surface_rms_after_m, 0.015);
  EXPECT_LT(drive.rmse(result.nodes), 0.03) << "tracked " << drive.rmse(tracked.nodes);
  // The same place in different rounds.
  double worst = 0.0;
  for (std::size_t i = 0; i < drive.truth.size(); ++i) {
    for (std::size_t k = i + 50; k < drive.truth.size(); ++k) {
      if (distance(drive.truth[i], drive.truth[k]) > 0.3) continue;
      const Pose2 error = between(
          between(drive.truth[i], drive.truth[k]),
          between(result.nodes[i].T_map_base, result.nodes[k].T_map_base));
      worst = std::max(worst, translationNorm(error));
    }
  }
  EXPECT_LT(worst, 0.03);
  for (const Closure& c : result.closures) {
    if (c.verdict != ClosureVerdict::kAccepted) continue;
    EXPECT_THAT(c.T_from_to, poseNear(between(drive.truth[c.from], drive.truth[c.to]), 0.25, 0.05));
  }
}

TEST(Finish, APoorStartIsRepaired) {
  // GIVEN an estimate that missed both slips
  const RingDrive drive(2.0, 1.0, 6);
  const TrackResult tracked = trackScans(drive.nodes, {}, 1);
  const FinishResult result = finishMap(tracked.nodes, {}, {});
  EXPECT_LT(drive.rmse(result.nodes), 0.04);
}

TEST(Finish, ThreadsDoNotChangeTheResult) {
  const RingDrive drive(1.5, 0.0, 8);
  FinishParams one;
  one.threads = 1;
  FinishParams four;
  four.threads = 4;
  const auto tracked = trackScans(drive.nodes, {}, 1).nodes;
  const FinishResult a = finishMap(tracked, one, {});
  const FinishResult b = finishMap(tracked, four, {});
  ASSERT_EQ(a.nodes.size(), b.nodes.size());
  for (std::size_t i = 0; i < a.nodes.size(); ++i) {
    ASSERT_EQ(a.nodes[i].T_map_base.x, b.nodes[i].T_map_base.x) << i;
    ASSERT_EQ(a.nodes[i].T_map_base.y, b.nodes[i].T_map_base.y) << i;
    ASSERT_EQ(a.nodes[i].T_map_base.phi, b.nodes[i].T_map_base.phi) << i;
  }
  EXPECT_EQ(a.closures.size(), b.closures.size());
}

TEST(Finish, FewOrEmptyScansAreFine) {
  EXPECT_TRUE(finishMap({}, {}, {}).nodes.empty());
  ScanNode node;
  node.T_map_base = {1.0, 2.0, 0.5};
  EXPECT_THAT(
      finishMap({node}, {}, {}).nodes.at(0).T_map_base, poseNear(Pose2{1.0, 2.0, 0.5}, 0.0, 0.0));
  // Scans without a single echo.
  ScanNode far = node;
  far.T_odom_base = {1.0, 0.0, 0.0};
  far.T_map_base = compose(node.T_map_base, far.T_odom_base);
  node.scan.ranges_m.assign(10, 0.0F);
  far.scan.ranges_m.assign(10, 0.0F);
  const auto result = finishMap({node, far}, {}, {});
  EXPECT_THAT(
      between(result.nodes.at(0).T_map_base, result.nodes.at(1).T_map_base),
      poseNear(Pose2{1.0, 0.0, 0.0}, 1e-6, 1e-6));
}

TEST(Finish, ProgressRisesAndMayStop) {
  const RingDrive drive(0.5, 0.0, 9);
  double last = 0.0;
  (void)finishMap(drive.nodes, {}, [&](double share) {
    EXPECT_GE(share, last);
    last = share;
  });
  EXPECT_DOUBLE_EQ(last, 1.0);
  EXPECT_THROW(
      (void)finishMap(drive.nodes, {}, [](double) { throw std::runtime_error("stop"); }),
      std::runtime_error);
}

}  // namespace
}  // namespace vestibule::mapping
