#include "vestibule/sensors/slips.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace vestibule {
namespace {

/// Where the odometry of a robot that stands for 100 s says it is, message by message.
std::vector<Pose2> standingRobot(const SlipParams& params, std::uint64_t seed) {
  SlipMaker slips(params, seed);
  std::vector<Pose2> poses(1);
  for (int i = 1; i <= 1000; ++i) {
    WheelOdometry odometry;
    odometry.stamp = Timestamp{i * 100'000'000LL};
    slips.apply(odometry);
    poses.push_back(compose(poses.back(), odometry.T_previous_now));
  }
  EXPECT_EQ(slips.count(), 3U);
  return poses;
}

TEST(SlipMaker, SpreadsEachSlipOverItsTime) {
  SlipParams params;
  params.every_s = 30.0;
  const std::vector<Pose2> poses = standingRobot(params, 1);
  // THEN the odometry moves for a second after 30, 60 and 90 s, and stands in between
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Pose2 step = between(poses[i - 1], poses[i]);
    const bool slipping = i > 300 && (i - 301) % 300 < 10;
    EXPECT_NEAR(translationNorm(step), slipping ? 0.1 : 0.0, 1e-6) << i;
    EXPECT_NEAR(std::abs(step.phi), slipping ? degToRad(2.0) : 0.0, 1e-6) << i;
  }
  EXPECT_NEAR(std::abs(between(poses[300], poses[320]).phi), degToRad(20.0), 1e-6);
}

TEST(SlipMaker, WithoutATimeASlipIsASingleStep) {
  SlipParams params;
  params.every_s = 30.0;
  params.lasts_s = 0.0;
  const std::vector<Pose2> poses = standingRobot(params, 1);
  int steps = 0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const double moved = distance(poses[i - 1], poses[i]);
    if (moved > 0.0) ++steps;
    EXPECT_TRUE(moved == 0.0 || std::abs(moved - 1.0) < 1e-9);
  }
  EXPECT_EQ(steps, 3);
}

TEST(SlipMaker, TheSeedDecides) {
  SlipParams params;
  params.every_s = 30.0;
  const Pose2 a = standingRobot(params, 1).back();
  EXPECT_EQ(distance(a, standingRobot(params, 1).back()), 0.0);
  EXPECT_GT(distance(a, standingRobot(params, 2).back()), 0.01);
}

}  // namespace
}  // namespace vestibule
