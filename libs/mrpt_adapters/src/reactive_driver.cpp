#include "vestibule/mrpt_adapters/reactive_driver.hpp"

#include <mrpt/config/CConfigFileMemory.h>
#include <mrpt/core/Clock.h>
#include <mrpt/kinematics/CVehicleVelCmd_DiffDriven.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/nav/reactive/CReactiveNavigationSystem.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>

#include "reactive_config.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::mrpt_adapters {
namespace {

/// Where MRPT's clock stands when a driver takes its first step. MRPT takes zero for "no time", and
/// a fixed start makes the results independent of the epoch of the data.
constexpr std::int64_t kClockStart_s = 1'000'000'000;
/// A goal counts as nearer when it is by this much.
constexpr double kProgress_m = 0.10;
constexpr double kProgress_rad = 0.10;
/// Moving this far also counts, for a while: the way around something leads away from the goal.
constexpr double kDetour_m = 1.5;
constexpr double kDetourFactor = 3.0;
constexpr double kAnyYaw = std::numeric_limits<double>::infinity();
/// Free room around the circle that the corners draw, for turning on the spot.
constexpr double kTurnRoom_m = 0.10;
constexpr double kTurnDone_rad = 0.15;
/// Slower than this for so long, and the robot turns on the spot to a goal that is not ahead.
constexpr double kCreeping_mps = 0.12;
constexpr double kCreeping_s = 2.0;
constexpr double kTurnGain_hz = 1.5;
constexpr double kMinTurn_radps = 0.12;

/// MRPT's clock follows the data while a driver computes, and is the machine's again afterwards.
class ClockGuard {
 public:
  explicit ClockGuard(double since_start_s) : before_(mrpt::Clock::getActiveClock()) {
    const auto ticks = std::chrono::duration_cast<mrpt::Clock::duration>(
        std::chrono::seconds(kClockStart_s) +
        std::chrono::nanoseconds(static_cast<std::int64_t>(std::llround(since_start_s * 1e9))));
    mrpt::Clock::setSimulatedTime(mrpt::Clock::time_point(ticks));
    mrpt::Clock::setActiveClock(mrpt::Clock::Simulated);
  }
  ~ClockGuard() { mrpt::Clock::setActiveClock(before_); }
  ClockGuard(const ClockGuard&) = delete;
  ClockGuard& operator=(const ClockGuard&) = delete;

 private:
  mrpt::Clock::Source before_;
};

/// A private folder for MRPT's collision tables, gone with this object.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string pattern =
        (std::filesystem::temp_directory_path() / "vestibule-nav-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) {
      throw InputError(
          "cannot create a folder in " + std::filesystem::temp_directory_path().string() +
          ": check its permissions, or set TMPDIR");
    }
    path_ = pattern;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

/// What MRPT asks and tells: a mailbox that step() fills and empties.
class RobotMailbox : public mrpt::nav::CRobot2NavInterface {
 public:
  RobotMailbox() { logging_enable_console_output = false; }

  Pose2 T_map_base;
  double v_mps = 0.0;
  double omega_radps = 0.0;
  const std::vector<Point2>* obstacles_base = nullptr;
  double since_start_s = 0.0;

  nav::Command command;
  int last_waypoint_reached = -1;
  bool way_blocked = false;
  bool target_blocked = false;
  bool collides = false;

  bool getCurrentPoseAndSpeeds(
      mrpt::math::TPose2D& pose,
      mrpt::math::TTwist2D& velocity_map,
      mrpt::system::TTimeStamp& timestamp,
      mrpt::math::TPose2D& odometry,
      std::string& /*frame_id*/) override {
    pose = T_map_base;
    odometry = T_map_base;
    velocity_map = {
        v_mps * std::cos(T_map_base.phi), v_mps * std::sin(T_map_base.phi), omega_radps};
    timestamp = mrpt::Clock::now();
    return true;
  }

  bool changeSpeeds(const mrpt::kinematics::CVehicleVelCmd& cmd) override {
    const auto* diff = dynamic_cast<const mrpt::kinematics::CVehicleVelCmd_DiffDriven*>(&cmd);
    if (diff == nullptr) return false;
    command = {diff->lin_vel, diff->ang_vel};
    return true;
  }
  bool stop(bool /*isEmergencyStop*/) override {
    command = {};
    return true;
  }
  mrpt::kinematics::CVehicleVelCmd::Ptr getEmergencyStopCmd() override { return getStopCmd(); }
  mrpt::kinematics::CVehicleVelCmd::Ptr getStopCmd() override {
    auto cmd = mrpt::kinematics::CVehicleVelCmd_DiffDriven::Create();
    cmd->setToStop();
    return cmd;
  }
  bool startWatchdog(float /*T_ms*/) override { return true; }
  bool stopWatchdog() override { return true; }

  bool senseObstacles(
      mrpt::maps::CSimplePointsMap& obstacles, mrpt::system::TTimeStamp& timestamp) override {
    obstacles.clear();
    for (const Point2& p : *obstacles_base) {
      obstacles.insertPoint(static_cast<float>(p.x), static_cast<float>(p.y), 0.5F);
    }
    timestamp = mrpt::Clock::now();
    return true;
  }

  void sendNavigationStartEvent() override {}
  void sendNavigationEndEvent() override {}
  void sendNavigationEndDueToErrorEvent() override {}
  void sendNewWaypointTargetEvent(int /*waypoint_index*/) override {}
  void sendWaypointReachedEvent(int waypoint_index, bool /*reached_nSkipped*/) override {
    last_waypoint_reached = std::max(last_waypoint_reached, waypoint_index);
  }
  void sendWaySeemsBlockedEvent() override { way_blocked = true; }
  void sendApparentCollisionEvent() override { collides = true; }
  void sendCannotGetCloserToBlockedTargetEvent() override { target_blocked = true; }

  double getNavigationTime() override { return since_start_s; }
  void resetNavigationTimer() override {}
};

double approach(double from, double to, double step) {
  return from + std::clamp(to - from, -step, step);
}

}  // namespace

void describe(ParamIo& io, ReactiveParams& params) {
  io.section("footprint", params.footprint);
  io.optional("security_margin_m", params.security_margin_m, nonNegative());
  io.optional("max_speed_mps", params.max_speed_mps, positive());
  io.optionalDegrees("max_yaw_rate_degps", params.max_yaw_rate_radps, positive());
  io.optional("max_accel_mps2", params.max_accel_mps2, positive());
  io.optionalDegrees("max_yaw_accel_degps2", params.max_yaw_accel_radps2, positive());
  io.optional("reference_distance_m", params.reference_distance_m, within(1.0, 20.0));
  io.optional("paths_per_ptg", params.paths_per_ptg, within(11, 401));
  io.optionalDegrees("turn_first_deg", params.turn_first_rad, within(20.0, 180.0));
  io.optional("blocked_after_s", params.blocked_after_s, positive());
}

struct ReactiveDriver::Impl {
  explicit Impl(const ReactiveParams& p) : params(p) {
    const ClockGuard clock(0.0);
    const ScratchFolder scratch;
    navigator = std::make_unique<mrpt::nav::CReactiveNavigationSystem>(robot, false, false);
    navigator->logging_enable_console_output = false;
    navigator->enableTimeLog(false);
    // On by default and printed by the destructor; the getter is const only.
    const_cast<mrpt::system::CTimeLogger&>(navigator->getDelaysTimeLogger()).disable();
    navigator->enableRethrowNavExceptions(true);
    mrpt::config::CConfigFileMemory config(reactiveConfig(params));
    navigator->loadConfigFile(config);
    // MRPT 2.5 does not read this from the configuration; by default it writes its collision tables
    // into the working folder, and reads there what another process may be writing.
    navigator->params_abstract_ptg_navigator.ptg_cache_files_directory = scratch.path();
    navigator->initialize();
  }

  ~Impl() { const_cast<mrpt::system::CTimeLogger&>(navigator->getDelaysTimeLogger()).clear(true); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  enum class Phase { kIdle, kTurnFirst, kDrive, kTurnLast };

  void startNavigation() {
    mrpt::nav::TWaypointSequence sequence;
    for (std::size_t i = reached; i < goals.size(); ++i) {
      const nav::Waypoint& goal = goals[i];
      const bool is_last = i + 1 == goals.size();
      // The robot is to pass every waypoint: none may be skipped.
      sequence.waypoints.emplace_back(
          goal.T_map_base.x,
          goal.T_map_base.y,
          goal.tolerance_m,
          false,
          std::nullopt,
          is_last ? 0.0 : 1.0);
    }
    robot.last_waypoint_reached = -1;
    robot.way_blocked = robot.target_blocked = robot.collides = false;
    reached_at_start = reached;
    navigator->cancel();
    navigator->resetNavError();
    navigator->navigateWaypoints(sequence);
  }

  void resetProgress(double now_s) {
    best_m = std::numeric_limits<double>::infinity();
    best_rad = std::numeric_limits<double>::infinity();
    nearer_s = moved_s = now_s;
    T_map_base_moved = robot.T_map_base;
  }

  /// False when the robot is stuck, or drives about without getting nearer to the goal.
  bool progresses(double now_s, double distance_m, double yaw_error_rad) {
    if (distance_m < best_m - kProgress_m || yaw_error_rad < best_rad - kProgress_rad) {
      best_m = std::min(best_m, distance_m);
      best_rad = std::min(best_rad, yaw_error_rad);
      nearer_s = moved_s = now_s;
      T_map_base_moved = robot.T_map_base;
    } else if (distance(T_map_base_moved, robot.T_map_base) > kDetour_m) {
      moved_s = now_s;
      T_map_base_moved = robot.T_map_base;
    }
    return now_s - moved_s <= params.blocked_after_s &&
           now_s - nearer_s <= kDetourFactor * params.blocked_after_s;
  }

  [[nodiscard]] bool roomToTurn(const std::vector<Point2>& obstacles) const {
    const double r = params.footprint.radius() + kTurnRoom_m;
    return std::none_of(obstacles.begin(), obstacles.end(), [r](const Point2& p) {
      return p.x * p.x + p.y * p.y < r * r;
    });
  }

  [[nodiscard]] nav::Command turn(double error_rad) const {
    const double limit = 0.75 * params.max_yaw_rate_radps;
    const double rate =
        std::clamp(kTurnGain_hz * std::abs(error_rad), std::min(kMinTurn_radps, limit), limit);
    return {0.0, std::copysign(rate, error_rad)};
  }

  /// Slower near obstacles, wherever they are around the robot.
  [[nodiscard]] double speedLimit(const std::vector<Point2>& obstacles) const {
    double clearance_m = std::numeric_limits<double>::infinity();
    for (const Point2& p : obstacles) {
      // What has been passed does not matter any more.
      if (p.x < -params.footprint.half_length_m) continue;
      clearance_m = std::min(clearance_m, params.footprint.signedDistance(p));
    }
    const double free_m = std::max(0.0, clearance_m - params.security_margin_m);
    return std::min(params.max_speed_mps, 0.25 + 0.9 * free_m);
  }

  nav::DriverStatus advance(double now_s, const std::vector<Point2>& obstacles);
  nav::Command shape(const nav::Command& wanted, double dt_s, const std::vector<Point2>& obstacles);

  ReactiveParams params;
  RobotMailbox robot;
  std::unique_ptr<mrpt::nav::CReactiveNavigationSystem> navigator;

  std::vector<nav::Waypoint> goals;
  std::size_t reached = 0;
  std::size_t reached_at_start = 0;  // when MRPT got its list
  Phase phase = Phase::kIdle;
  bool leg_is_new = false;
  std::optional<Timestamp> first_stamp;
  double last_s = 0.0;
  nav::Command last_command;
  double best_m = 0.0;
  double best_rad = 0.0;
  double nearer_s = 0.0;
  double moved_s = 0.0;
  Pose2 T_map_base_moved;
  double creeping_since_s = 0.0;
};

nav::DriverStatus ReactiveDriver::Impl::advance(
    double now_s, const std::vector<Point2>& obstacles) {
  nav::DriverStatus status;
  status.state = nav::DriverState::kDriving;
  const auto blocked = [&](const std::string& why) {
    phase = Phase::kIdle;
    status.state = nav::DriverState::kBlocked;
    status.command = {};
    status.reason = why;
    status.waypoints_reached = reached;
    return status;
  };

  if (phase != Phase::kTurnLast) {
    const nav::Waypoint& goal = goals[reached];
    const Pose2 T_base_goal = between(robot.T_map_base, goal.T_map_base);
    const double distance_m = translationNorm(T_base_goal);
    const double bearing_rad = std::atan2(T_base_goal.y, T_base_goal.x);

    if (leg_is_new) {
      leg_is_new = false;
      creeping_since_s = now_s;
      resetProgress(now_s);
      const bool turn_first = std::abs(bearing_rad) > params.turn_first_rad &&
                              distance_m > goal.tolerance_m && roomToTurn(obstacles);
      phase = turn_first ? Phase::kTurnFirst : Phase::kDrive;
      if (phase == Phase::kDrive &&
          (reached == 0 ||
           navigator->getCurrentState() != mrpt::nav::CAbstractNavigator::NAVIGATING)) {
        startNavigation();
      }
    }
    if (phase == Phase::kTurnFirst) {
      if (std::abs(bearing_rad) > kTurnDone_rad && roomToTurn(obstacles)) {
        if (!progresses(now_s, distance_m, std::abs(bearing_rad))) return blocked("cannot turn");
        status.command = turn(bearing_rad);
        status.waypoints_reached = reached;
        return status;
      }
      phase = Phase::kDrive;
      creeping_since_s = now_s;
      startNavigation();
    }

    navigator->navigationStep();
    const std::size_t before = reached;
    reached = std::min(
        goals.size(), reached_at_start + static_cast<std::size_t>(robot.last_waypoint_reached + 1));
    if (reached != before) leg_is_new = true;

    if (reached < goals.size()) {
      status.command = robot.command;
      status.waypoints_reached = reached;
      // All paths lead forward: with the goal behind and a wall ahead MRPT only creeps.
      if (robot.command.v_mps > kCreeping_mps) creeping_since_s = now_s;
      if (!leg_is_new && now_s - creeping_since_s > kCreeping_s &&
          std::abs(bearing_rad) > params.turn_first_rad && roomToTurn(obstacles)) {
        phase = Phase::kTurnFirst;
      }
      if (navigator->getCurrentState() == mrpt::nav::CAbstractNavigator::NAV_ERROR) {
        const std::string why = navigator->getErrorReason().error_msg;
        return blocked(why.empty() ? "no way found" : why);
      }
      if (robot.target_blocked) return blocked("an obstacle stands on the goal");
      if (robot.way_blocked) return blocked("the way seems blocked");
      if (!leg_is_new && !progresses(now_s, distance_m, kAnyYaw)) {
        return blocked(
            robot.collides ? "an obstacle is within the security margin" : "no progress");
      }
      return status;
    }
    navigator->cancel();
    resetProgress(now_s);
    phase = Phase::kTurnLast;
  }

  status.waypoints_reached = goals.size() - 1;
  const nav::Waypoint& last = goals.back();
  const double yaw_error = angleDiff(last.T_map_base.phi, robot.T_map_base.phi);
  if (!last.has_yaw || std::abs(yaw_error) <= last.yaw_tolerance_rad) {
    phase = Phase::kIdle;
    status.state = nav::DriverState::kArrived;
    status.waypoints_reached = goals.size();
    return status;
  }
  if (!progresses(now_s, 0.0, std::abs(yaw_error))) {
    return blocked("cannot turn to the yaw of the waypoint");
  }
  status.command = turn(yaw_error);
  return status;
}

nav::Command ReactiveDriver::Impl::shape(
    const nav::Command& wanted, double dt_s, const std::vector<Point2>& obstacles) {
  nav::Command command = wanted;
  const double limit = speedLimit(obstacles);
  if (command.v_mps > limit) {
    // Both together: the path stays the same, only slower.
    command.omega_radps *= limit / command.v_mps;
    command.v_mps = limit;
  }
  // Speeding up is limited here, braking is not: that is for the robot's own controller.
  if (std::abs(command.v_mps) > std::abs(last_command.v_mps)) {
    command.v_mps = approach(last_command.v_mps, command.v_mps, params.max_accel_mps2 * dt_s);
  }
  command.omega_radps =
      approach(last_command.omega_radps, command.omega_radps, params.max_yaw_accel_radps2 * dt_s);
  return command;
}

ReactiveDriver::ReactiveDriver(const ReactiveParams& params) {
  if (params.paths_per_ptg % 2 == 0) {
    throw ConfigError(
        "paths_per_ptg = " + std::to_string(params.paths_per_ptg) +
        ": must be odd, so that one path leads straight ahead");
  }
  impl_ = std::make_unique<Impl>(params);
}

ReactiveDriver::~ReactiveDriver() = default;

void ReactiveDriver::setGoals(const std::vector<nav::Waypoint>& goals) {
  Impl& d = *impl_;
  d.goals = goals;
  d.reached = 0;
  d.leg_is_new = true;
  d.phase = goals.empty() ? Impl::Phase::kIdle : Impl::Phase::kDrive;
}

void ReactiveDriver::stop() { setGoals({}); }

nav::DriverStatus ReactiveDriver::step(
    Timestamp stamp,
    const Pose2& T_map_base,
    double v_mps,
    double omega_radps,
    const std::vector<Point2>& obstacles_base) {
  Impl& d = *impl_;
  if (!d.first_stamp) d.first_stamp = stamp;
  const double now_s = toSeconds(stamp - *d.first_stamp);
  const double dt_s = std::clamp(now_s - d.last_s, 0.0, 0.2);
  d.last_s = now_s;
  d.robot.T_map_base = T_map_base;
  d.robot.v_mps = v_mps;
  d.robot.omega_radps = omega_radps;
  d.robot.obstacles_base = &obstacles_base;
  d.robot.since_start_s = now_s;

  nav::DriverStatus status;
  if (d.phase == Impl::Phase::kIdle) {
    status.waypoints_reached = d.reached;
    d.last_command = {};
    return status;
  }
  const ClockGuard clock(now_s);
  status = d.advance(now_s, obstacles_base);
  status.command = status.state == nav::DriverState::kDriving
                       ? d.shape(status.command, dt_s, obstacles_base)
                       : nav::Command{};
  d.last_command = status.command;
  return status;
}

}  // namespace vestibule::mrpt_adapters
