#include "vestibule/nav/mission_runner.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

namespace vestibule::nav {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Passes one waypoint per second; can be told to be blocked.
class FakeDriver : public Driver {
 public:
  int goals_set = 0;
  std::vector<std::string> goals;
  int blocked_times = 0;
  std::vector<Point2> last_obstacles;

  void setGoals(const std::vector<Waypoint>& waypoints) override {
    ++goals_set;
    goals.clear();
    for (const Waypoint& w : waypoints) goals.push_back(w.name);
    steps_ = 0;
  }
  DriverStatus step(
      Timestamp, const Pose2&, double, double, const std::vector<Point2>& obstacles) override {
    last_obstacles = obstacles;
    DriverStatus status;
    status.state = DriverState::kDriving;
    status.command = {0.4, 0.0};
    if (blocked_times > 0) {
      --blocked_times;
      status.state = DriverState::kBlocked;
      status.reason = "a cow";
      return status;
    }
    ++steps_;
    status.waypoints_reached = std::min<std::size_t>(goals.size(), steps_ / 10);
    if (status.waypoints_reached == goals.size()) status.state = DriverState::kArrived;
    return status;
  }
  void stop() override { goals.clear(); }

 private:
  std::size_t steps_ = 0;
};

class FakeHost : public MissionHost {
 public:
  std::vector<std::string> calls;
  bool mode_reached = true;
  std::optional<std::string> answer;
  void takePhoto(Timestamp, const Path& path, const Task& task) override {
    calls.push_back("photo " + task.file + " on " + path.name);
  }
  void requestLocalization(LocalizationMode mode) override {
    calls.push_back("request " + std::string(toString(mode)));
  }
  bool localizationReached(LocalizationMode) override { return mode_reached; }
  std::optional<std::string> operatorAnswer(const Task&) override { return answer; }
};

class Log : public Observer {
 public:
  std::vector<std::string> lines;
  std::vector<std::string> warnings;
  void onMission(const MissionEvent& e) override {
    lines.push_back(std::string(toString(e.kind)) + "|" + e.path + "|" + e.waypoint + "|" + e.text);
  }
  void onWarning(const WarningEvent& e) override { warnings.push_back(e.text); }
};

Waypoint named(const char* name) {
  Waypoint w;
  w.name = name;
  return w;
}

Task task(TaskType type) {
  Task t;
  t.type = type;
  t.source = {"m.yaml", 12};
  t.duration_s = 1.0;
  t.timeout_s = 2.0;
  return t;
}

class Runner : public ::testing::Test {
 protected:
  FakeDriver driver;
  FakeHost host;
  Log log;
  Observers observers;
  Mission mission;
  MissionRunnerParams params;
  std::unique_ptr<MissionRunner> runner;
  RunnerInput input;
  std::vector<Point2> scan;
  RunnerOutput output;
  std::function<void()> before_step = [] {};

  void SetUp() override {
    observers.attach(log);
    mission.name = "test";
    mission.paths.push_back({"one", {named("a"), named("b")}, {}});
  }

  /// Steps at 10 Hz until the mission ends or `limit_s` has passed; the robot does as it is told.
  void run(double limit_s) {
    if (!runner) {
      runner = std::make_unique<MissionRunner>(mission, params, driver, host, observers);
    }
    input.scan_base = &scan;
    for (int k = 0; k < static_cast<int>(limit_s * 10) && !runner->finished(); ++k) {
      input.stamp = input.stamp + Duration(100'000'000);
      input.pose_stamp = input.stamp;
      input.scan_stamp = input.stamp;
      before_step();
      output = runner->step(input);
      input.v_mps = output.command.v_mps;
      input.omega_radps = output.command.omega_radps;
      input.T_odom_base =
          compose(input.T_odom_base, expSe2({0.1 * input.v_mps, 0.0, 0.1 * input.omega_radps}));
      input.T_map_base = input.T_odom_base;
    }
  }
};

TEST_F(Runner, PassesPathsWaypointsAndTasksInOrder) {
  mission.paths[0].tasks = {task(TaskType::kWait)};
  Task photo = task(TaskType::kPhoto);
  photo.file = "trough.png";
  Task to_indoor = task(TaskType::kSwitchLocalization);
  to_indoor.mode = LocalizationMode::kIndoor;
  Task ask = task(TaskType::kInput);
  ask.default_answer = "yes";
  mission.paths.push_back({"two", {named("c")}, {to_indoor, photo, ask}});
  run(60.0);
  EXPECT_EQ(runner->state(), RunnerState::kDone);
  EXPECT_EQ(runner->waypointsReached(), 3U);
  EXPECT_EQ(runner->waypointsTotal(), 3U);
  EXPECT_THAT(host.calls, ElementsAre("request indoor", "photo trough.png on two"));
  const auto k = [](MissionEvent::Kind kind) { return std::string(toString(kind)); };
  using Kind = MissionEvent::Kind;
  EXPECT_THAT(
      log.lines,
      ElementsAre(
          k(Kind::kPathStarted) + "|one||2 waypoints",
          k(Kind::kWaypointReached) + "|one|a|1 of 2",
          k(Kind::kWaypointReached) + "|one|b|2 of 2",
          k(Kind::kTaskStarted) + "|one||wait",
          k(Kind::kTaskDone) + "|one||wait: stood for 1.0 s",
          k(Kind::kPathStarted) + "|two||1 waypoints",
          k(Kind::kWaypointReached) + "|two|c|1 of 1",
          k(Kind::kTaskStarted) + "|two||switch_localization",
          k(Kind::kTaskDone) + "|two||switch_localization: indoor",
          k(Kind::kTaskStarted) + "|two||photo",
          k(Kind::kTaskDone) + "|two||photo: trough.png",
          k(Kind::kTaskStarted) + "|two||input",
          k(Kind::kTaskDone) + "|two||input: yes (by default)",
          k(Kind::kDone) + "|||test"));
}

TEST_F(Runner, WaitsOnlyWhileTheRobotStands) {
  mission.paths[0].tasks = {task(TaskType::kWait)};
  run(2.1);
  ASSERT_EQ(runner->state(), RunnerState::kInTask);
  before_step = [this] { input.v_mps = 0.2; };  // pushed
  run(5.0);
  EXPECT_EQ(runner->state(), RunnerState::kInTask);
  before_step = [] {};
  run(0.9);
  EXPECT_EQ(runner->state(), RunnerState::kInTask);
  run(0.3);
  EXPECT_EQ(runner->state(), RunnerState::kDone);
}

TEST_F(Runner, AbortsWhenLocalizationDoesNotSwitchOrNobodyAnswers) {
  Task outdoor = task(TaskType::kSwitchLocalization);
  outdoor.mode = LocalizationMode::kOutdoor;
  mission.paths[0].tasks = {outdoor};
  host.mode_reached = false;
  run(20.0);
  EXPECT_EQ(runner->state(), RunnerState::kAborted);
  EXPECT_EQ(runner->abortReason(), "m.yaml:12: localization did not switch to outdoor in 2.0 s");

  runner.reset();
  mission.paths[0].tasks = {task(TaskType::kInput)};
  run(20.0);
  EXPECT_EQ(
      runner->abortReason(), "m.yaml:12: nobody answered for 2.0 s and the task has no default");
}

TEST_F(Runner, TheOperatorsAnswerEndsAnInputTask) {
  mission.paths[0].tasks = {task(TaskType::kInput)};
  host.answer = "full";
  run(20.0);
  EXPECT_EQ(runner->state(), RunnerState::kDone);
  EXPECT_THAT(log.lines[4], HasSubstr("input: full"));
}

TEST_F(Runner, RecoversFromABlockageAndGoesOnWithWhatIsLeft) {
  run(1.2);  // passed a
  driver.blocked_times = 2;
  double backed_off_m = 0.0;
  double spun_rad = 0.0;
  before_step = [&] {
    if (output.source != CommandSource::kRecovery) return;
    backed_off_m -= 0.1 * output.command.v_mps;
    spun_rad += 0.1 * std::abs(output.command.omega_radps);
  };
  run(60.0);
  EXPECT_EQ(runner->state(), RunnerState::kDone);
  EXPECT_EQ(runner->recoveries(), 2);
  EXPECT_EQ(runner->waypointsReached(), 2U);
  EXPECT_NEAR(backed_off_m, params.recovery.back_off_m, 0.03);
  EXPECT_NEAR(spun_rad, params.recovery.spin_rad, 0.05);
  EXPECT_THAT(
      log.warnings,
      ElementsAre("recovery on the way to 'b': a cow", "recovery on the way to 'b': a cow"));
}

TEST_F(Runner, GivesUpAfterTheLastRecovery) {
  driver.blocked_times = 1000;
  params.recovery.attempts = 3;
  run(200.0);
  EXPECT_EQ(runner->state(), RunnerState::kAborted);
  EXPECT_EQ(runner->recoveries(), 3);
  EXPECT_EQ(
      runner->abortReason(), "blocked on the way to 'a' of path 'one' after 3 recoveries: a cow");
  EXPECT_DOUBLE_EQ(output.command.v_mps, 0.0);
}

TEST_F(Runner, TheEmergencyStopPausesAndReleasingItResumes) {
  run(1.2);
  runner->setEmergencyStop(true);
  run(5.0);
  EXPECT_EQ(output.state, RunnerState::kPaused);
  EXPECT_DOUBLE_EQ(output.command.v_mps, 0.0);
  EXPECT_EQ(output.limit, "emergency stop");
  runner->setEmergencyStop(false);
  run(0.1);
  EXPECT_THAT(driver.goals, ElementsAre("b"));
  run(5.0);
  EXPECT_EQ(runner->state(), RunnerState::kDone);
  EXPECT_EQ(runner->waypointsReached(), 2U);
}

TEST_F(Runner, StandsWithoutAPoseResumesWithOneAndGivesUpIfItStaysAway) {
  run(1.2);
  before_step = [this] { input.pose_stamp.reset(); };
  run(10.0);
  EXPECT_EQ(output.state, RunnerState::kDriving);
  EXPECT_DOUBLE_EQ(output.command.v_mps, 0.0);
  before_step = [] {};
  run(0.1);
  EXPECT_GT(output.command.v_mps, 0.0);
  EXPECT_THAT(driver.goals, ElementsAre("b"));
  before_step = [this] { input.pose_stamp.reset(); };
  run(59.0);
  EXPECT_EQ(runner->state(), RunnerState::kDriving);
  run(2.0);
  EXPECT_EQ(runner->abortReason(), "no pose for 60.0 s");
}

TEST_F(Runner, ObstaclesStayInPlaceBetweenScans) {
  scan = {{5.0, 0.0}};
  run(0.1);
  const Timestamp scan_stamp = input.stamp;
  before_step = [&] { input.scan_stamp = scan_stamp; };
  run(0.3);
  ASSERT_EQ(driver.last_obstacles.size(), 1U);
  EXPECT_NEAR(driver.last_obstacles[0].x, 5.0 - 0.3 * 0.4, 1e-9);
}

TEST(MissionRunnerParams, SurviveAWriteAndARead) {
  MissionRunnerParams params;
  params.recovery.attempts = 7;
  params.mux.collision_stop.margin_m = 0.3;
  const auto read = parseParams<MissionRunnerParams>(dumpParams(params), "nav.yaml");
  EXPECT_EQ(read.recovery.attempts, 7);
  EXPECT_DOUBLE_EQ(read.mux.collision_stop.margin_m, 0.3);
  EXPECT_EQ(dumpParams(read), dumpParams(params));
}

}  // namespace
}  // namespace vestibule::nav
