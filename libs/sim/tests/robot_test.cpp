#include "vestibule/sim/robot.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/sim/simulator.hpp"

namespace vestibule::sim {
namespace {

RobotParams withoutSlip() {
  RobotParams params;
  params.grip_left = params.grip_right = 1.0;
  params.slip_sigma = params.side_slip = params.burst_rate_hz = 0.0;
  return params;
}

/// Drives on the true ground without a world.
void drive(GroundRobot& robot, double seconds) {
  const auto n = static_cast<int>(std::lround(seconds / toSeconds(kTruthStep)));
  for (int i = 0; i < n; ++i) {
    const Pose2 step = robot.advance(kTruthStep);
    robot.setPose(compose(robot.pose(), step));
  }
}

TEST(SkidSteer, SpinsAboutItsInstantaneousCentre) {
  const RobotParams params = withoutSlip();
  GroundRobot robot(params, {1.0, 2.0, 0.3}, 1);
  // With opposite wheel speeds v_x / omega is the middle of the tread ICRs.
  const Point2 p_base_centre{params.icr_x_m, 0.5 * (params.icr_left_m + params.icr_right_m)};
  const Point2 before = transform(robot.pose(), p_base_centre);
  robot.command(0.0, 1.0);
  drive(robot, 4.0);
  const Point2 after = transform(robot.pose(), p_base_centre);
  EXPECT_NEAR(after.x, before.x, 1e-6);
  EXPECT_NEAR(after.y, before.y, 1e-6);
  // The wheels believe in the nominal track; the ground turns the robot less.
  const double believed_rad = (robot.rightTravel() - robot.leftTravel()) / params.nominal_track_m;
  const double share = params.nominal_track_m / (params.icr_left_m - params.icr_right_m);
  EXPECT_NEAR(wrapToPi(0.3 + believed_rad * share), robot.pose().phi, 1e-6);
  EXPECT_GT(believed_rad, 3.0);
}

TEST(SkidSteer, FollowsTheWheelLagAndTheAccelerationLimit) {
  RobotParams params = withoutSlip();
  params.max_accel_mps2 = 1e6;
  GroundRobot fast(params, {}, 1);
  fast.command(0.8, 0.0);
  drive(fast, 2.0);
  // The integral of a first-order step response: v (t - lag (1 - exp(-t / lag))).
  EXPECT_NEAR(fast.pose().x, 0.8 * (2.0 - 0.15 - 0.02), 0.003);

  params.max_accel_mps2 = 0.5;
  GroundRobot slow(params, {}, 1);
  slow.command(5.0, 0.0);  // limited to max_v_mps
  drive(slow, 10.0);
  EXPECT_NEAR(slow.pose().x, 1.0 * (10.0 - 1.0 - 0.15 - 0.02), 0.01);
  slow.command(0.0, 0.0);
  drive(slow, 5.0);
  const Pose2 stopped = slow.pose();
  drive(slow, 1.0);
  EXPECT_EQ(slow.pose().x, stopped.x) << "creeps at standstill";
}

TEST(SkidSteer, SlipMakesTheWheelsOverCountAndVariesWithTheSeed) {
  const RobotParams params;
  double sum = 0.0;
  double sum2 = 0.0;
  constexpr int kSeeds = 40;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    GroundRobot robot(params, {}, seed);
    robot.command(0.8, 0.0);
    drive(robot, 30.0);
    const double wheels_m = 0.5 * (robot.leftTravel() + robot.rightTravel());
    const double ratio = std::hypot(robot.pose().x, robot.pose().y) / wheels_m;
    sum += ratio;
    sum2 += ratio * ratio;
  }
  const double mean = sum / kSeeds;
  const double sigma = std::sqrt(sum2 / kSeeds - mean * mean);
  // Grip 0.9775; 0.6 bursts of 0.5 s in 30 s take away another 0.2 %.
  EXPECT_NEAR(mean, 0.975, 0.005);
  EXPECT_GT(sigma, 0.001);
  EXPECT_LT(sigma, 0.02);
}

}  // namespace
}  // namespace vestibule::sim
