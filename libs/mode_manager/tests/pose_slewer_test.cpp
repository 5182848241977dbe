#include "vestibule/mode_manager/pose_slewer.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "matchers.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::mode_manager {
namespace {

TEST(PoseSlewer, TheBaseNeverStepsHoweverTheTargetJumps) {
  // GIVEN a robot far from the origin of odom, where turning T_map_odom would throw the base about
  PoseSlewer slewer({});
  RandomStream rng(3, "slew");
  Pose2 T_odom_base{200.0, -150.0, 1.0};
  slewer.start({0}, {});
  Pose2 last = compose(slewer.T_map_odom(), T_odom_base);
  Pose2 target;
  for (int i = 1; i <= 2000; ++i) {
    // WHEN the target jumps by metres and degrees every few seconds
    if (i % 100 == 0) target = {rng.normal(0, 3), rng.normal(0, 3), rng.normal(0, 0.1)};
    const Pose2 increment = expSe2({0.02, 0.0, 0.004});
    const Pose2 predicted = compose(last, increment);
    T_odom_base = compose(T_odom_base, increment);
    slewer.step(timestampFromSeconds(0.02 * i), T_odom_base, target);
    const Pose2 now = compose(slewer.T_map_odom(), T_odom_base);
    // THEN the base moves by the odometry plus at most the allowed correction
    ASSERT_LE(distance(now, predicted), 0.25 * 0.02 + 1e-9);
    ASSERT_LE(std::abs(angleDiff(now.phi, predicted.phi)), degToRad(2.5) * 0.02 + 1e-9);
    last = now;
  }
}

TEST(PoseSlewer, ReachesTheTargetAndSaysWhatIsPending) {
  PoseSlewer slewer({});
  const Pose2 T_odom_base{5.0, 1.0, 0.5};
  const Pose2 target{1.0, 0.0, 0.05};
  slewer.start({0}, {});
  slewer.step(timestampFromSeconds(0.02), T_odom_base, target);
  EXPECT_NEAR(
      translationNorm(slewer.pending()),
      distance(compose(target, T_odom_base), T_odom_base) - 0.25 * 0.02,
      1e-9);
  for (int i = 2; i < 1500; ++i) {
    slewer.step(timestampFromSeconds(0.02 * i), T_odom_base, target);
  }
  EXPECT_THAT(
      compose(slewer.T_map_odom(), T_odom_base),
      poseNear(compose(target, T_odom_base), 1e-3, 1e-4));
}

TEST(PoseSlewer, APauseWithoutAuthorityIsNotMadeUpInOneStep) {
  PoseSlewer slewer({});
  slewer.start({0}, {});
  slewer.hold(timestampFromSeconds(100.0));
  slewer.step(timestampFromSeconds(100.1), {}, Pose2{5.0, 0.0, 0.0});
  EXPECT_LE(slewer.T_map_odom().x, 0.025 + 1e-12);
}

}  // namespace
}  // namespace vestibule::mode_manager
