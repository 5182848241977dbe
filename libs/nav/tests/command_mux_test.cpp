#include "vestibule/nav/command_mux.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace vestibule::nav {
namespace {

CollisionStopParams stopParams() {
  CollisionStopParams p;
  p.margin_m = 0.15;
  p.deceleration_mps2 = 0.5;
  p.reaction_s = 0.2;
  return p;
}

TEST(Footprint, SignedDistance) {
  const Footprint f{0.5, 0.3};
  EXPECT_DOUBLE_EQ(f.signedDistance({1.5, 0.0}), 1.0);
  EXPECT_DOUBLE_EQ(f.signedDistance({-0.8, -0.7}), 0.5);
  EXPECT_DOUBLE_EQ(f.signedDistance({0.45, 0.0}), -0.05);
}

TEST(CollisionStop, LetsFreeMotionPass) {
  const CollisionStop stop(stopParams(), Footprint{});
  const auto r = stop.limit({0.8, 0.1}, {{3.0, 0.0}, {1.0, 1.0}, {-0.8, 0.0}});
  EXPECT_DOUBLE_EQ(r.scale, 1.0);
  EXPECT_DOUBLE_EQ(r.command.v_mps, 0.8);
  EXPECT_NEAR(r.clearance_m, 0.305, 1e-9);
}

TEST(CollisionStop, SlowsDownThenStopsInFrontOfAPoint) {
  const CollisionStop stop(stopParams(), Footprint{});
  double last_v = 1.0;
  for (const double gap_m : {1.2, 0.7, 0.45, 0.3, 0.16, 0.1}) {
    const auto r = stop.limit({0.8, 0.0}, {{0.495 + gap_m, 0.1}});
    EXPECT_LE(r.command.v_mps, last_v) << gap_m;
    // v t + v^2 / 2a must fit into what is left before the margin.
    const double v = r.command.v_mps;
    EXPECT_LE(v * 0.2 + v * v / (2 * 0.5), std::max(0.0, gap_m - 0.15) + 1e-9) << gap_m;
    last_v = v;
  }
  EXPECT_DOUBLE_EQ(stop.limit({0.8, 0.0}, {{0.495 + 0.1, 0.1}}).command.v_mps, 0.0);
}

TEST(CollisionStop, ABrakingRobotNeverTouchesAWall) {
  const CollisionStop stop(stopParams(), Footprint{});
  double x = 0.0;
  double v = 0.0;
  for (int k = 0; k < 400; ++k) {
    const auto r = stop.limit({0.8, 0.0}, {{4.0 - x, 0.0}, {4.0 - x, 0.2}});
    for (int i = 0; i < 20; ++i) {
      v += (r.command.v_mps - v) * 0.005 / 0.15;
      x += v * 0.005;
    }
  }
  EXPECT_LT(x, 4.0 - 0.495 - 0.14);
  EXPECT_GT(x, 4.0 - 0.495 - 0.45);
}

TEST(CollisionStop, CornersCountWhenTurningOnTheSpot) {
  const CollisionStop stop(stopParams(), Footprint{});
  // Beside the left rear wheel, inside the circle of the corners: only turning right sweeps it.
  EXPECT_LT(stop.limit({0.0, -0.8}, {{-0.35, 0.5}}).scale, 1.0);
  EXPECT_DOUBLE_EQ(stop.limit({0.0, -0.8}, {{-0.4, 0.49}}).command.omega_radps, -0.0);
  EXPECT_DOUBLE_EQ(stop.limit({0.0, 0.8}, {{-0.35, 0.5}}).scale, 1.0);
  EXPECT_DOUBLE_EQ(stop.limit({0.0, 0.8}, {{0.0, 0.9}}).scale, 1.0);
  // Straight on along a wall is free.
  EXPECT_DOUBLE_EQ(stop.limit({0.8, 0.0}, {{-0.2, 0.55}, {0.0, 0.55}, {1.0, 0.55}}).scale, 1.0);
}

TEST(CollisionStop, LetsTheRobotLeaveAPointThatIsTooNear) {
  const CollisionStop stop(stopParams(), Footprint{});
  const std::vector<Point2> close{{0.55, 0.0}};
  EXPECT_DOUBLE_EQ(stop.limit({-0.2, 0.0}, close).command.v_mps, -0.2);
  EXPECT_DOUBLE_EQ(stop.limit({0.2, 0.0}, close).command.v_mps, 0.0);
}

class Mux : public ::testing::Test {
 protected:
  CommandMux mux{CommandMuxParams{}, Footprint{}};
  Timestamp now{10'000'000'000};
  CommandInputs fresh{now, now, now};
};

TEST_F(Mux, RecoveryBeatsMissionAndTheEmergencyStopBeatsBoth) {
  auto r = mux.select(fresh, Command{0.5, 0.1}, std::nullopt, {});
  EXPECT_EQ(r.source, CommandSource::kMission);
  EXPECT_DOUBLE_EQ(r.command.v_mps, 0.5);
  r = mux.select(fresh, Command{0.5, 0.1}, Command{-0.2, 0.0}, {});
  EXPECT_EQ(r.source, CommandSource::kRecovery);
  EXPECT_DOUBLE_EQ(r.command.v_mps, -0.2);
  mux.setEmergencyStop(true);
  r = mux.select(fresh, Command{0.5, 0.1}, Command{-0.2, 0.0}, {});
  EXPECT_EQ(r.source, CommandSource::kEmergencyStop);
  EXPECT_DOUBLE_EQ(r.command.v_mps, 0.0);
  EXPECT_EQ(r.limit, "emergency stop");
  mux.setEmergencyStop(false);
  EXPECT_DOUBLE_EQ(mux.select(fresh, Command{0.5, 0.1}, {}, {}).command.v_mps, 0.5);
  EXPECT_EQ(mux.select(fresh, {}, {}, {}).source, CommandSource::kNone);
}

TEST_F(Mux, StandsStillWithoutFreshPoseAndScan) {
  const Command go{0.5, 0.1};
  const auto limitOf = [&](const CommandInputs& inputs) {
    const auto r = mux.select(inputs, go, {}, {});
    EXPECT_TRUE(r.limit.empty() || r.command.v_mps == 0.0);
    return std::string(r.limit);
  };
  const Timestamp old{9'400'000'000};
  const Timestamp recent{9'600'000'000};
  EXPECT_EQ(limitOf({now, std::nullopt, now}), "no pose");
  EXPECT_EQ(limitOf({now, old, now}), "stale pose");
  EXPECT_EQ(limitOf({now, now, std::nullopt}), "no scan");
  EXPECT_EQ(limitOf({now, now, old}), "stale scan");
  EXPECT_EQ(limitOf({now, recent, recent}), "");
}

TEST_F(Mux, NamesTheObstacleAndRefusesNan) {
  EXPECT_EQ(mux.select(fresh, Command{0.8, 0.0}, {}, {{0.7, 0.0}}).limit, "obstacle");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto r = mux.select(fresh, Command{nan, 0.0}, {}, {});
  EXPECT_EQ(r.limit, "not a number");
  EXPECT_DOUBLE_EQ(r.command.v_mps, 0.0);
}

}  // namespace
}  // namespace vestibule::nav
