#include "vestibule/mrpt_adapters/reactive_driver.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mrpt/core/Clock.h>

#include <filesystem>

#include "closed_loop.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/nav/mission_runner.hpp"

namespace vestibule::mrpt_adapters {
namespace {

using nav::MissionRunner;
using nav::RunnerState;
using nav::Waypoint;

Waypoint at(const char* name, double x, double y, std::optional<double> yaw_deg = std::nullopt) {
  Waypoint w;
  w.name = name;
  w.T_map_base = {x, y, degToRad(yaw_deg.value_or(0.0))};
  w.has_yaw = yaw_deg.has_value();
  w.tolerance_m = 0.3;
  return w;
}

class SilentHost : public nav::MissionHost {
 public:
  void takePhoto(Timestamp, const nav::Path&, const nav::Task&) override {}
  void requestLocalization(nav::LocalizationMode) override {}
  bool localizationReached(nav::LocalizationMode) override { return true; }
  std::optional<std::string> operatorAnswer(const nav::Task&) override { return std::nullopt; }
};

class ReachedNames : public Observer {
 public:
  std::vector<std::string> names;
  std::vector<std::string> warnings;
  void onMission(const MissionEvent& event) override {
    if (event.kind == MissionEvent::Kind::kWaypointReached) names.push_back(event.waypoint);
  }
  void onWarning(const WarningEvent& event) override { warnings.push_back(event.text); }
};

struct Outcome {
  RunnerState state = RunnerState::kDriving;
  std::string abort_reason;
  std::vector<std::string> reached;
  std::vector<std::string> warnings;
  std::vector<Pose2> trajectory;
  double smallest_clearance_m = 0.0;
  double duration_s = 0.0;
};

/// Drives one path in the closed loop: scan and control at 10 Hz.
Outcome run(
    const std::vector<Segment>& walls,
    const Pose2& start,
    const std::vector<Waypoint>& waypoints,
    double limit_s,
    std::uint64_t seed = 1) {
  ClosedLoop loop(walls, start, seed);
  ReactiveDriver driver(ReactiveParams{});
  SilentHost host;
  ReachedNames names;
  Observers observers;
  observers.attach(names);
  nav::Mission mission;
  mission.name = "test";
  mission.paths.push_back({"path", waypoints, {}});
  MissionRunner runner(mission, nav::MissionRunnerParams{}, driver, host, observers);

  Outcome outcome;
  for (int k = 0; k < static_cast<int>(limit_s * 10.0) && !runner.finished(); ++k) {
    const Timestamp stamp{std::int64_t{1'700'000'000} * 1'000'000'000 + k * 100'000'000LL};
    const auto scan = loop.scan();
    nav::RunnerInput input;
    input.stamp = stamp;
    input.T_map_base = loop.pose();
    input.pose_stamp = stamp;
    input.T_odom_base = loop.pose();
    input.v_mps = loop.v();
    input.omega_radps = loop.omega();
    input.scan_base = &scan;
    input.scan_stamp = stamp;
    input.p_base_laser = ClosedLoop::laser();
    loop.drive(runner.step(input).command, 0.1);
    outcome.trajectory.push_back(loop.pose());
    outcome.duration_s += 0.1;
  }
  outcome.state = runner.state();
  outcome.abort_reason = runner.abortReason();
  outcome.reached = names.names;
  outcome.warnings = names.warnings;
  outcome.smallest_clearance_m = loop.smallestClearance();
  return outcome;
}

std::vector<Segment> wallWithDoor(double x, double y_door) {
  return {{{x, -12.0}, {x, y_door - 1.5}}, {{x, y_door + 1.5}, {x, 12.0}}};
}

void expectArrival(const Outcome& outcome) {
  EXPECT_EQ(outcome.state, RunnerState::kDone)
      << outcome.abort_reason << " at (" << outcome.trajectory.back().x << ", "
      << outcome.trajectory.back().y << ") after " << outcome.duration_s << " s";
  EXPECT_GE(outcome.smallest_clearance_m, 0.15);
  EXPECT_THAT(outcome.warnings, ::testing::IsEmpty());
  EXPECT_LT(outcome.duration_s, 60.0);
}

TEST(ReactiveDriver, PassesAThreeMetreDoorToAGoalBehindIt) {
  for (const double y_start : {-4.0, 3.0}) {
    SCOPED_TRACE(y_start);
    const Outcome outcome =
        run(wallWithDoor(6.0, 0.0),
            {0.0, y_start, 0.0},
            {at("outside", 3.5, 0.0), at("inside", 9.0, 0.0, 90.0)},
            120.0);
    expectArrival(outcome);
    EXPECT_LT(std::hypot(outcome.trajectory.back().x - 9.0, outcome.trajectory.back().y), 0.4);
    EXPECT_NEAR(outcome.trajectory.back().phi, kPi / 2.0, 0.1);
  }
}

TEST(ReactiveDriver, GoesAroundABoxOnTheStraightLine) {
  for (const double y : {-0.3, 0.0}) {
    SCOPED_TRACE(y);
    expectArrival(run(
        ClosedLoop::box(4.5, y - 0.5, 5.5, y + 0.5), {0, 0, 0}, {at("goal", 10.0, 0.0)}, 120.0));
  }
}

TEST(ReactiveDriver, PassesWaypointsInOrderAlsoBehindIt) {
  const Outcome outcome =
      run(ClosedLoop::box(-8.0, -8.0, 12.0, 8.0),
          {0, 0, 0},
          {at("a", 6.0, 0.0), at("b", 6.0, 4.0), at("c", -3.0, 4.0, 180.0)},
          120.0);
  expectArrival(outcome);
  EXPECT_THAT(outcome.reached, ::testing::ElementsAre("a", "b", "c"));
}

TEST(ReactiveDriver, DrivesALaneAndTurnsAroundInIt) {
  // 3 m wide, closed at the far end.
  const std::vector<Segment> lane{
      {{-2.0, 1.5}, {12.0, 1.5}}, {{-2.0, -1.5}, {12.0, -1.5}}, {{12.0, -1.5}, {12.0, 1.5}}};
  expectArrival(
      run(lane, {0, 0.2, 0.1}, {at("end", 10.0, 0.0), at("back", 0.0, 0.0, 180.0)}, 120.0));
}

TEST(ReactiveDriver, ReportsAnUnreachableGoalAsBlocked) {
  const Outcome outcome =
      run(ClosedLoop::box(6.0, -2.0, 10.0, 2.0), {0, 0, 0}, {at("walled in", 8.0, 0.0)}, 400.0);
  EXPECT_EQ(outcome.state, RunnerState::kAborted);
  EXPECT_THAT(outcome.abort_reason, ::testing::HasSubstr("blocked on the way to 'walled in'"));
  EXPECT_GE(outcome.smallest_clearance_m, 0.15);
  EXPECT_LT(outcome.duration_s, 300.0);
}

TEST(ReactiveDriver, EqualInputsGiveEqualBitsTwiceInOneProcess) {
  const auto drive = [] {
    return run(
        wallWithDoor(6.0, 0.5), {0, -2, 0.3}, {at("a", 4.0, 0.5), at("b", 9.0, 1.0)}, 60.0, 5);
  };
  const Outcome first = drive();
  const Outcome second = drive();
  ASSERT_EQ(first.trajectory.size(), second.trajectory.size());
  for (std::size_t i = 0; i < first.trajectory.size(); ++i) {
    ASSERT_EQ(first.trajectory[i].x, second.trajectory[i].x) << "step " << i;
    ASSERT_EQ(first.trajectory[i].y, second.trajectory[i].y) << "step " << i;
    ASSERT_EQ(first.trajectory[i].phi, second.trajectory[i].phi) << "step " << i;
  }
}

TEST(ReactiveDriver, LeavesNoFilesAndNoSimulatedClockBehindAndPrintsNothing) {
  const auto filesHere = [] {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(".")) {
      names.push_back(entry.path().string());
    }
    std::sort(names.begin(), names.end());
    return names;
  };
  const auto before = filesHere();
  const auto clock_before = mrpt::Clock::getActiveClock();
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  (void)run({}, {0, 0, 0}, {at("goal", 2.0, 0.0)}, 20.0);
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(filesHere(), before);
  EXPECT_EQ(mrpt::Clock::getActiveClock(), clock_before);
}

TEST(ReactiveDriver, RefusesParametersThatMakeNoSense) {
  ReactiveParams params;
  params.paths_per_ptg = 60;
  EXPECT_THROW(ReactiveDriver{params}, ConfigError);
}

TEST(ReactiveDriver, ParametersSurviveAWriteAndARead) {
  ReactiveParams params;
  params.max_speed_mps = 0.6;
  params.turn_first_rad = degToRad(70.0);
  const auto read = parseParams<ReactiveParams>(dumpParams(params), "driver.yaml");
  EXPECT_DOUBLE_EQ(read.max_speed_mps, 0.6);
  EXPECT_NEAR(read.turn_first_rad, degToRad(70.0), 1e-12);
  EXPECT_EQ(dumpParams(read), dumpParams(params));
}

}  // namespace
}  // namespace vestibule::mrpt_adapters
