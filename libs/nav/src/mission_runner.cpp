#include "vestibule/nav/mission_runner.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "vestibule/core/angles.hpp"

namespace vestibule::nav {
namespace {

std::string seconds(double s) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.1f s", s);
  return buffer;
}

}  // namespace

void describe(ParamIo& io, RecoveryParams& params) {
  io.optional("attempts", params.attempts, nonNegative());
  io.optional("wait_s", params.wait_s, nonNegative());
  io.optional("back_off_m", params.back_off_m, nonNegative());
  io.optional("back_off_mps", params.back_off_mps, positive());
  io.optionalDegrees("spin_deg", params.spin_rad, within(0.0, 170.0));
  io.optionalDegrees("spin_degps", params.spin_radps, positive());
  io.optional("step_timeout_s", params.step_timeout_s, positive());
}

void describe(ParamIo& io, MissionRunnerParams& params) {
  io.section("footprint", params.footprint);
  io.section("command_mux", params.mux);
  io.section("obstacle_memory", params.memory);
  io.section("recovery", params.recovery);
  io.optional("standstill_mps", params.standstill_mps, positive());
  io.optionalDegrees("standstill_degps", params.standstill_radps, positive());
  io.optional("lost_pose_abort_s", params.lost_pose_abort_s, positive());
}

std::string_view toString(RunnerState state) {
  switch (state) {
    case RunnerState::kDriving:
      return "driving";
    case RunnerState::kInTask:
      return "in task";
    case RunnerState::kRecovering:
      return "recovering";
    case RunnerState::kPaused:
      return "paused";
    case RunnerState::kDone:
      return "done";
    case RunnerState::kAborted:
      break;
  }
  return "aborted";
}

MissionRunner::MissionRunner(
    Mission mission,
    const MissionRunnerParams& params,
    Driver& driver,
    MissionHost& host,
    const Observers& observers)
    : mission_(std::move(mission)),
      params_(params),
      driver_(driver),
      host_(host),
      observers_(observers),
      mux_(params.mux, params.footprint),
      memory_(params.memory, params.footprint) {}

RunnerState MissionRunner::state() const {
  if (phase_ == Phase::kDone) return RunnerState::kDone;
  if (phase_ == Phase::kAborted) return RunnerState::kAborted;
  if (paused_) return RunnerState::kPaused;
  if (phase_ == Phase::kTask) return RunnerState::kInTask;
  if (phase_ == Phase::kRecovery) return RunnerState::kRecovering;
  return RunnerState::kDriving;
}

bool MissionRunner::finished() const { return phase_ == Phase::kDone || phase_ == Phase::kAborted; }

std::size_t MissionRunner::waypointsTotal() const {
  std::size_t n = 0;
  for (const Path& path : mission_.paths) n += path.waypoints.size();
  return n;
}

std::vector<Waypoint> MissionRunner::remainingWaypoints() const {
  if (path_ >= mission_.paths.size()) return {};
  const auto& all = mission_.paths[path_].waypoints;
  const auto passed = static_cast<std::ptrdiff_t>(std::min(next_waypoint_, all.size()));
  return {all.begin() + passed, all.end()};
}

RunnerOutput MissionRunner::step(const RunnerInput& input) {
  lookAround(input);
  std::optional<Command> mission;
  std::optional<Command> recovery;

  if (mux_.emergencyStop() && !finished()) {
    paused_ = true;
    standing_since_.reset();
  } else if (!finished()) {
    if (std::exchange(paused_, false) && phase_ == Phase::kDriving) resumeDriving();
    if (phase_ == Phase::kStartPath) startPath(input.stamp);
    if (phase_ == Phase::kTask) {
      mission = runTask(input);
    } else if (!finished() && hasPose(input)) {
      if (phase_ == Phase::kDriving) {
        mission = drive(input);
      } else if (phase_ == Phase::kRecovery) {
        recovery = recover(input);
      }
    }
  }

  const CommandMux::Result chosen = mux_.select(
      {input.stamp, input.pose_stamp, input.scan_stamp}, mission, recovery, obstacles_base_);
  return {chosen.command, state(), chosen.source, chosen.limit, chosen.clearance_m};
}

void MissionRunner::lookAround(const RunnerInput& input) {
  if (input.scan_base != nullptr && input.scan_stamp && input.scan_stamp != scan_stamp_) {
    scan_stamp_ = input.scan_stamp;
    obstacles_base_ =
        memory_.update(input.stamp, input.T_odom_base, *input.scan_base, input.p_base_laser);
    obstacles_odom_.clear();
    for (const Point2& p : obstacles_base_) {
      obstacles_odom_.push_back(transform(input.T_odom_base, p));
    }
    return;
  }
  // Between two scans the robot moves on.
  const Pose2 T_base_odom = inverse(input.T_odom_base);
  for (std::size_t i = 0; i < obstacles_odom_.size(); ++i) {
    obstacles_base_[i] = transform(T_base_odom, obstacles_odom_[i]);
  }
}

bool MissionRunner::hasPose(const RunnerInput& input) {
  const bool has_pose = input.pose_stamp && isFinite(input.T_map_base) &&
                        toSeconds(input.stamp - *input.pose_stamp) <= params_.mux.max_pose_age_s;
  if (has_pose) {
    // The driver must not count the time without a pose as time without progress.
    if (std::exchange(lost_since_, std::nullopt) && phase_ == Phase::kDriving) resumeDriving();
    return true;
  }
  if (!lost_since_) lost_since_ = input.stamp;
  if (toSeconds(input.stamp - *lost_since_) > params_.lost_pose_abort_s) {
    abort(input.stamp, "no pose for " + seconds(params_.lost_pose_abort_s));
  }
  return false;
}

void MissionRunner::startPath(Timestamp stamp) {
  if (path_ >= mission_.paths.size()) {
    phase_ = Phase::kDone;
    driver_.stop();
    emit(stamp, MissionEvent::Kind::kDone, "", mission_.name);
    return;
  }
  next_waypoint_ = 0;
  attempts_ = 0;
  phase_ = Phase::kDriving;
  emit(
      stamp,
      MissionEvent::Kind::kPathStarted,
      "",
      std::to_string(mission_.paths[path_].waypoints.size()) + " waypoints");
  resumeDriving();
}

void MissionRunner::resumeDriving() {
  goals_start_ = next_waypoint_;
  driver_.setGoals(remainingWaypoints());
}

void MissionRunner::passWaypoints(Timestamp stamp, std::size_t reached_of_goals) {
  const auto& all = mission_.paths[path_].waypoints;
  const std::size_t reached = std::min(goals_start_ + reached_of_goals, all.size());
  for (; next_waypoint_ < reached; ++next_waypoint_) {
    ++waypoints_reached_total_;
    attempts_ = 0;
    emit(
        stamp,
        MissionEvent::Kind::kWaypointReached,
        all[next_waypoint_].name,
        std::to_string(next_waypoint_ + 1) + " of " + std::to_string(all.size()));
  }
}

std::optional<Command> MissionRunner::drive(const RunnerInput& input) {
  const DriverStatus status =
      driver_.step(input.stamp, input.T_map_base, input.v_mps, input.omega_radps, obstacles_base_);
  passWaypoints(input.stamp, status.waypoints_reached);
  if (status.state == DriverState::kBlocked) {
    enterRecovery(input, status.reason);
    return std::nullopt;
  }
  if (status.state == DriverState::kArrived) {
    driver_.stop();
    task_ = 0;
    task_started_ = false;
    standing_since_.reset();
    phase_ = Phase::kTask;
    if (mission_.paths[path_].tasks.empty()) endPath(input.stamp);
    return Command{};
  }
  return status.command;
}

void MissionRunner::endPath(Timestamp stamp) {
  ++path_;
  phase_ = Phase::kStartPath;
  // The last path's end is the mission's end: report it now, not one step later.
  if (path_ >= mission_.paths.size()) startPath(stamp);
}

std::optional<Command> MissionRunner::runTask(const RunnerInput& input) {
  const Path& path = mission_.paths[path_];
  const Task& task = path.tasks[task_];
  if (!task_started_) {
    task_started_ = true;
    task_since_ = input.stamp;
    standing_since_.reset();
    emit(input.stamp, MissionEvent::Kind::kTaskStarted, "", std::string(toString(task.type)));
    if (task.type == TaskType::kSwitchLocalization) host_.requestLocalization(task.mode);
  }
  if (!stands(input)) {
    standing_since_.reset();
  } else if (!standing_since_) {
    standing_since_ = input.stamp;
  }
  const double task_s = toSeconds(input.stamp - task_since_);

  switch (task.type) {
    case TaskType::kWait:
      if (standing_since_ && toSeconds(input.stamp - *standing_since_) >= task.duration_s) {
        finishTask(input.stamp, "wait: stood for " + seconds(task.duration_s));
      }
      break;
    case TaskType::kInput:
      if (const auto answer = host_.operatorAnswer(task)) {
        finishTask(input.stamp, "input: " + *answer);
      } else if (task_s >= task.timeout_s) {
        if (task.default_answer) {
          finishTask(input.stamp, "input: " + *task.default_answer + " (by default)");
        } else {
          abort(
              input.stamp,
              task.source.text() + ": nobody answered for " + seconds(task.timeout_s) +
                  " and the task has no default");
        }
      }
      break;
    case TaskType::kPhoto:
      if (standing_since_) {
        host_.takePhoto(input.stamp, path, task);
        finishTask(input.stamp, "photo: " + (task.file.empty() ? path.name : task.file));
      }
      break;
    case TaskType::kSwitchLocalization:
      if (host_.localizationReached(task.mode)) {
        finishTask(input.stamp, "switch_localization: " + std::string(toString(task.mode)));
      } else if (task_s >= task.timeout_s) {
        abort(
            input.stamp,
            task.source.text() + ": localization did not switch to " +
                std::string(toString(task.mode)) + " in " + seconds(task.timeout_s));
      }
      break;
  }
  return Command{};
}

void MissionRunner::finishTask(Timestamp stamp, const std::string& text) {
  emit(stamp, MissionEvent::Kind::kTaskDone, "", text);
  task_started_ = false;
  ++task_;
  if (task_ >= mission_.paths[path_].tasks.size()) endPath(stamp);
}

void MissionRunner::enterRecovery(const RunnerInput& input, const std::string& reason) {
  driver_.stop();
  const auto& waypoints = mission_.paths[path_].waypoints;
  const std::string goal =
      next_waypoint_ < waypoints.size() ? waypoints[next_waypoint_].name : "the end";
  if (attempts_ >= params_.recovery.attempts) {
    abort(
        input.stamp,
        "blocked on the way to '" + goal + "' of path '" + mission_.paths[path_].name + "' after " +
            std::to_string(attempts_) + " recoveries: " + reason);
    return;
  }
  ++attempts_;
  ++recoveries_total_;
  observers_.emit(WarningEvent{
      input.stamp,
      "nav",
      "recovery on the way to '" + goal + "': " + reason,
      static_cast<double>(attempts_),
      static_cast<double>(params_.recovery.attempts)});

  phase_ = Phase::kRecovery;
  recovery_step_ = RecoveryStep::kWait;
  recovery_since_ = input.stamp;
  recovery_spins_ = attempts_ % 2 == 0;
  spin_sign_ = 1.0;
  if (next_waypoint_ < waypoints.size()) {
    const Pose2 T_base_goal = between(input.T_map_base, waypoints[next_waypoint_].T_map_base);
    if (T_base_goal.y < 0.0) spin_sign_ = -1.0;
  }
}

std::optional<Command> MissionRunner::recover(const RunnerInput& input) {
  const RecoveryParams& p = params_.recovery;
  const double step_s = toSeconds(input.stamp - recovery_since_);
  if (recovery_step_ == RecoveryStep::kWait) {
    const bool settled = stands(input) || step_s >= p.step_timeout_s;
    if (step_s < p.wait_s || !settled) return Command{};
    recovery_step_ = RecoveryStep::kMove;
    recovery_since_ = input.stamp;
    T_odom_base_recovery_ = input.T_odom_base;
  }
  const Pose2 moved = between(T_odom_base_recovery_, input.T_odom_base);
  const bool done =
      recovery_spins_ ? std::abs(moved.phi) >= p.spin_rad : translationNorm(moved) >= p.back_off_m;
  if (done || toSeconds(input.stamp - recovery_since_) >= p.step_timeout_s) {
    phase_ = Phase::kDriving;
    resumeDriving();
    return Command{};
  }
  if (recovery_spins_) return Command{0.0, spin_sign_ * p.spin_radps};
  return Command{-p.back_off_mps, 0.0};
}

void MissionRunner::abort(Timestamp stamp, const std::string& reason) {
  driver_.stop();
  phase_ = Phase::kAborted;
  abort_reason_ = reason;
  emit(stamp, MissionEvent::Kind::kAborted, "", reason);
}

void MissionRunner::emit(
    Timestamp stamp,
    MissionEvent::Kind kind,
    const std::string& waypoint,
    const std::string& text) const {
  const std::string path = path_ < mission_.paths.size() ? mission_.paths[path_].name : "";
  observers_.emit(MissionEvent{stamp, kind, path, waypoint, text});
}

bool MissionRunner::stands(const RunnerInput& input) const {
  return std::abs(input.v_mps) < params_.standstill_mps &&
         std::abs(input.omega_radps) < params_.standstill_radps;
}

}  // namespace vestibule::nav
