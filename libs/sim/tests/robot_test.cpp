#include "vestibule/sim/robot.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/sim/simulator.hpp"
#include "vestibule/sim/wheels.hpp"

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

TEST(SkidSteer, WaitsForItsCommandAndStandsBelowTheDeadBand) {
  RobotParams params = withoutSlip();
  params.command_latency_s = 0.2;
  params.dead_band_mps = 0.05;
  GroundRobot robot(params, {}, 1);
  robot.command(0.5, 0.0);
  drive(robot, 0.2);
  EXPECT_EQ(robot.pose().x, 0.0) << "the command is still on its way";
  drive(robot, 1.0);
  EXPECT_GT(robot.pose().x, 0.1);
  GroundRobot weak(params, {}, 1);
  weak.command(0.04, 0.0);
  drive(weak, 2.0);
  EXPECT_EQ(weak.pose().x, 0.0) << "too slow for its motors";
}

TEST(Differential, TurnsOnItsNominalTrackAndItsOdometryIsRight) {
  RobotParams params = withoutSlip();
  params.drive = DriveType::kDifferential;
  GroundRobot robot(params, {}, 1);
  WheelParams encoders;
  encoders.ticks_per_m = 1e6;
  WheelModel wheels(encoders, params);
  Pose2 believed;
  robot.command(0.5, 0.4);
  for (int i = 0; i < 500; ++i) {
    drive(robot, 0.02);
    const auto message = wheels.measure({}, robot.leftTravel(), robot.rightTravel());
    believed = compose(believed, message.T_previous_now);
  }
  EXPECT_GT(robot.pose().phi + 2.0 * kPi, 3.0);
  EXPECT_NEAR(believed.x, robot.pose().x, 1e-3);
  EXPECT_NEAR(believed.y, robot.pose().y, 1e-3);
  EXPECT_NEAR(angleDiff(believed.phi, robot.pose().phi), 0.0, 1e-4);
  // The base itself is the centre of a turn on the spot, unlike with treads.
  GroundRobot spinning(params, {1.0, 2.0, 0.0}, 1);
  spinning.command(0.0, 1.0);
  drive(spinning, 3.0);
  EXPECT_NEAR(spinning.pose().x, 1.0, 1e-6);
  EXPECT_NEAR(spinning.pose().y, 2.0, 1e-6);
  EXPECT_GT(spinning.pose().phi, 2.0);
}

RobotParams car() {
  RobotParams params = withoutSlip();
  params.drive = DriveType::kAckermann;
  params.wheelbase_m = 2.0;
  params.nominal_track_m = 1.2;
  params.max_v_mps = 3.0;
  return params;
}

TEST(Ackermann, DrivesACircleOfWheelbaseOverTangent) {
  const RobotParams params = car();
  GroundRobot robot(params, {}, 1);
  robot.command(1.0, 0.2);  // a radius of 5 m
  drive(robot, 5.0);
  EXPECT_NEAR(std::tan(robot.steering()), 2.0 / 5.0, 1e-6);
  const Pose2 start = robot.pose();
  const double left_m = robot.leftTravel();
  const double right_m = robot.rightTravel();
  drive(robot, 10.0);
  const double turned_rad = (robot.rightTravel() - right_m - robot.leftTravel() + left_m) / 1.2;
  EXPECT_NEAR(turned_rad, 2.0, 0.01) << "0.2 rad/s for 10 s";
  EXPECT_NEAR(angleDiff(robot.pose().phi, start.phi), turned_rad, 1e-3);
  // Chord of a circle of 5 m.
  EXPECT_NEAR(
      std::hypot(robot.pose().x - start.x, robot.pose().y - start.y),
      2.0 * 5.0 * std::sin(0.5 * turned_rad),
      0.01);
}

TEST(Ackermann, CannotTurnOnTheSpotNorSharperThanItsSteering) {
  const RobotParams params = car();
  GroundRobot standing(params, {}, 1);
  standing.command(0.0, 1.0);
  drive(standing, 3.0);
  EXPECT_EQ(standing.pose().phi, 0.0);
  GroundRobot tight(params, {}, 1);
  tight.command(0.5, 2.0);
  drive(tight, 0.1);
  EXPECT_LT(tight.steering(), 0.11) << "60 deg/s at most";
  drive(tight, 3.0);
  EXPECT_NEAR(tight.steering(), params.max_steering_rad, 1e-9);
}

TEST(Ackermann, AMisalignedSteeringBendsTheWayAndItsOdometryDoesNotKnow) {
  RobotParams params = car();
  params.steering_offset_rad = degToRad(1.0);
  GroundRobot robot(params, {}, 1);
  WheelModel wheels({}, params);
  Pose2 believed;
  robot.command(1.0, 0.0);
  for (int i = 0; i < 500; ++i) {
    drive(robot, 0.02);
    believed = compose(
        believed,
        wheels.measure({}, robot.leftTravel(), robot.rightTravel(), robot.steering())
            .T_previous_now);
  }
  const double way_m = 0.5 * (robot.leftTravel() + robot.rightTravel());
  EXPECT_GT(way_m, 8.0);
  EXPECT_NEAR(robot.pose().phi, way_m * std::tan(degToRad(1.0)) / 2.0, 1e-3);
  EXPECT_NEAR(believed.phi, 0.0, 1e-9);
  EXPECT_NEAR(believed.x, way_m, 1e-3);
}

TEST(GroundClasses, ChangeGripTurningAndSlip) {
  const RobotParams params = withoutSlip();
  const auto driven = [&params](const GroundClass& ground, double omega_radps) {
    GroundRobot robot(params, {}, 1);
    robot.command(0.5, omega_radps);
    double turned_rad = 0.0;
    for (int i = 0; i < 600; ++i) {
      const Pose2 step = robot.advance(kTruthStep, ground);
      turned_rad += step.phi;
      robot.setPose(compose(robot.pose(), step));
    }
    return std::pair(robot.pose().x, turned_rad);
  };
  GroundClass mud{"mud", 1.0, 0.8, 1.0, 0.0};
  EXPECT_NEAR(driven(mud, 0.0).first / driven({}, 0.0).first, 0.8, 1e-6);
  GroundClass rubber{"rubber", 1.25, 1.0, 1.0, 0.0};
  EXPECT_NEAR(driven({}, 0.5).second / driven(rubber, 0.5).second, 1.25, 1e-6);
}

TEST(SlipBursts, CostTheSlippingSideItsGripForAWhile) {
  RobotParams params = withoutSlip();
  GroundRobot robot(params, {}, 1);
  robot.command(0.8, 0.0);
  drive(robot, 3.0);
  const double before_rad = robot.pose().phi;
  robot.forceSlip(0.5, 1.0, std::chrono::seconds(1));
  drive(robot, 2.0);
  // The left side gives half its way for a second: turns left by 0.4 m over the ICR distance.
  const double turned_rad = robot.pose().phi - before_rad;
  EXPECT_NEAR(turned_rad, 0.4 / (params.icr_left_m - params.icr_right_m), 0.01);
  EXPECT_NEAR(robot.leftTravel(), robot.rightTravel(), 1e-9) << "the encoders see nothing";
}

}  // namespace
}  // namespace vestibule::sim
