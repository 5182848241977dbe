#include "vestibule/metrics/transition.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule::metrics {
namespace {

struct Drive {
  Trajectory T_odom_base;
  Trajectory T_map_base;
};

/// 10 s at 1 m/s and 0.5 rad/s, outputs at 20 Hz, odometry at 33 Hz; `T_map_odom(t)` is the
/// caller's.
template <class Correction>
Drive drive(const Correction& T_map_odom) {
  Drive d;
  const auto pose = [](double t) { return expSe2({t, 0.0, 0.5 * t}); };
  for (double t = -0.03; t < 10.1; t += 0.03) {
    d.T_odom_base.push_back({timestampFromSeconds(t), pose(t)});
  }
  for (double t = 0.0; t < 10.0; t += 0.05) {
    d.T_map_base.push_back({timestampFromSeconds(t), compose(T_map_odom(t), pose(t))});
  }
  return d;
}

TEST(LargestCorrection, IsZeroForAConstantFrameThoughTheRobotMoves) {
  const Drive d = drive([](double) { return Pose2(100, 50, 1); });
  const Step step = largestCorrection(d.T_map_base, d.T_odom_base);
  EXPECT_GT(step.pairs, 300u);
  EXPECT_LT(step.position_m, 1e-6);
  EXPECT_LT(step.yaw_rad, 1e-6);
  EXPECT_NEAR(largestJump(d.T_map_base).position_m, 0.05, 1e-3);
  EXPECT_NEAR(largestJump(d.T_map_base).yaw_rad, 0.025, 1e-6);
}

TEST(LargestCorrection, FindsAStepAndWhen) {
  const Drive d = drive([](double t) { return Pose2(t < 4.975 ? 0.0 : 0.4, 0, 0); });
  const Step step = largestCorrection(d.T_map_base, d.T_odom_base);
  EXPECT_NEAR(step.position_m, 0.4, 1e-6);
  EXPECT_NEAR(toSeconds(step.position_stamp), 5.0, 1e-6);
}

TEST(LargestCorrection, MeasuresASlewPerWindow) {
  // 0.2 m/s and 2 deg/s, turned about the base: 0.02 m and 0.2 deg in 100 ms.
  const Drive plain = drive([](double) { return Pose2(); });
  Drive d = plain;
  for (auto& p : d.T_map_base) {
    const double t = toSeconds(p.stamp);
    p.pose = Pose2(p.pose.x + 0.2 * t, p.pose.y, wrapToPi(p.pose.phi));
  }
  EXPECT_NEAR(largestCorrection(d.T_map_base, d.T_odom_base).position_m, 0.02, 1e-4);
  d = plain;
  for (auto& p : d.T_map_base)
    p.pose.phi = wrapToPi(p.pose.phi + degToRad(2.0) * toSeconds(p.stamp));
  EXPECT_NEAR(radToDeg(largestCorrection(d.T_map_base, d.T_odom_base).yaw_rad), 0.2, 1e-3);
}

TEST(LargestCorrection, ComparesTheNextOutputWhereTheyAreRare) {
  Trajectory odometry;
  Trajectory published;
  for (int i = 0; i < 5; ++i) {
    odometry.push_back({timestampFromSeconds(i), Pose2(i, 0, 0)});
    published.push_back({timestampFromSeconds(i), Pose2(i, i == 3 ? 0.7 : 0.0, 0)});
  }
  EXPECT_NEAR(largestCorrection(published, odometry).position_m, 0.7, 1e-9);
}

}  // namespace
}  // namespace vestibule::metrics
