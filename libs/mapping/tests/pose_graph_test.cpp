#include "vestibule/mapping/pose_graph.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "matchers.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::mapping {
namespace {

Eigen::Matrix3d information(double sigma_m, double sigma_rad) {
  Eigen::Matrix3d I = Eigen::Matrix3d::Zero();
  I.diagonal() << 1.0 / (sigma_m * sigma_m), 1.0 / (sigma_m * sigma_m),
      1.0 / (sigma_rad * sigma_rad);
  return I;
}

/// Two rounds of a circle of 10 m; the odometry turns a little too much.
struct TwoRounds {
  std::vector<Pose2> truth;
  std::vector<Pose2> start;
  std::vector<PoseConstraint> chain;

  TwoRounds() {
    RandomStream random(7, "two rounds");
    constexpr int kPerRound = 100;
    for (int i = 0; i < 2 * kPerRound; ++i) {
      const double a = 2.0 * kPi * i / kPerRound;
      truth.push_back({10.0 * std::cos(a) - 10.0, 10.0 * std::sin(a), wrapToPi(a + kPi / 2.0)});
    }
    start.push_back(truth.front());
    for (std::size_t i = 1; i < truth.size(); ++i) {
      Pose2 step = between(truth[i - 1], truth[i]);
      step.x += random.normal(0.0, 0.01);
      step.y += random.normal(0.0, 0.01);
      step.phi += 0.002 + random.normal(0.0, 0.003);
      chain.push_back({i - 1, i, step, information(0.015, 0.004), false});
      start.push_back(compose(start.back(), step));
    }
  }
  [[nodiscard]] PoseConstraint closure(std::size_t a, std::size_t b) const {
    return {a, b, between(truth[a], truth[b]), information(0.02, 0.004), true};
  }
  [[nodiscard]] double worst(const std::vector<Pose2>& poses) const {
    double worst = 0.0;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      worst = std::max(worst, distance(poses[i], truth[i]));
    }
    return worst;
  }
};

TEST(PoseGraph, ClosuresPullTheDriftOut) {
  const TwoRounds drive;
  auto constraints = drive.chain;
  for (std::size_t i = 0; i < 100; i += 10) constraints.push_back(drive.closure(i, i + 100));
  ASSERT_GT(drive.worst(drive.start), 2.0);
  const auto result = optimisePoseGraph(drive.start, constraints);
  // The circle itself may be a bit too small or large: only one place of it is known.
  EXPECT_LT(drive.worst(result.poses), 0.8);
  for (std::size_t i = 0; i < 100; i += 10) {
    EXPECT_THAT(
        between(result.poses[i], result.poses[i + 100]),
        poseNear(between(drive.truth[i], drive.truth[i + 100]), 0.03, 0.01));
  }
  EXPECT_EQ(result.poses.front().x, drive.start.front().x) << "the first node stays";
}

TEST(PoseGraph, AHundredFalseClosuresDoNotBreakIt) {
  const TwoRounds drive;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    auto constraints = drive.chain;
    for (std::size_t i = 0; i < 100; i += 4) constraints.push_back(drive.closure(i, i + 100));
    const auto clean = optimisePoseGraph(drive.start, constraints);
    const std::size_t true_end = constraints.size();
    RandomStream random(seed, "false closures");
    for (int i = 0; i < 100; ++i) {
      const auto a = static_cast<std::size_t>(random.uniform(0.0, 150.0));
      const auto b = a + 20 + static_cast<std::size_t>(random.uniform(0.0, 29.0));
      PoseConstraint wrong = drive.closure(a, b);
      wrong.T_from_to = {random.normal(0.0, 1.0), random.normal(0.0, 1.0), random.normal(0.0, 0.5)};
      constraints.push_back(wrong);
    }
    const auto result = optimisePoseGraph(drive.start, constraints);
    for (std::size_t i = 0; i < result.poses.size(); ++i) {
      EXPECT_LT(distance(result.poses[i], clean.poses[i]), 0.05) << "node " << i;
    }
    for (std::size_t k = drive.chain.size(); k < constraints.size(); ++k) {
      if (k < true_end) {
        EXPECT_GT(result.weights[k], 0.5) << "a true closure was voted out: " << k;
      } else {
        EXPECT_LT(result.weights[k], 0.1) << "a false closure is believed: " << k;
      }
    }
  }
}

TEST(PoseGraph, ADirectionWithoutInformationIsLeftToOthers) {
  // GIVEN a corridor along x: the closure knows nothing about x
  std::vector<Pose2> start{{0, 0, 0}, {1.0, 0.05, 0}, {2.0, 0.15, 0}};
  Eigen::Matrix3d across = information(0.01, 0.01);
  across.row(0).setZero();
  std::vector<PoseConstraint> constraints{
      {0, 1, {1.0, 0.05, 0.0}, information(0.05, 0.05), false},
      {1, 2, {1.0, 0.1, 0.0}, information(0.05, 0.05), false},
      {0, 2, {7.0, 0.0, 0.0}, across, true}};
  const auto result = optimisePoseGraph(start, constraints);
  EXPECT_NEAR(result.poses[2].x, 2.0, 0.05);
  EXPECT_NEAR(result.poses[2].y, 0.0, 0.02);
}

TEST(PoseGraph, SmallGraphsAreFine) {
  EXPECT_TRUE(optimisePoseGraph({}, {}).poses.empty());
  EXPECT_EQ(optimisePoseGraph({Pose2{1, 2, 3}}, {}).poses.size(), 1U);
}

TEST(PoseGraph, G2oHasVerticesAndUpperTriangles) {
  Eigen::Matrix3d I;
  I << 1, 2, 3, 2, 4, 5, 3, 5, 6;
  EXPECT_EQ(
      g2oOf({{0, 0, 0}, {1.5, -2, 0.25}}, {{0, 1, {1.5, -2, 0.25}, I, false}}),
      "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1.5 -2 0.25\nFIX 0\n"
      "EDGE_SE2 0 1 1.5 -2 0.25 1 2 3 4 5 6\n");
}

}  // namespace
}  // namespace vestibule::mapping
