#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/events.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/nav/command_mux.hpp"
#include "vestibule/nav/driver.hpp"
#include "vestibule/nav/mission.hpp"
#include "vestibule/nav/obstacle_memory.hpp"

namespace vestibule::nav {

struct RecoveryParams {
  int attempts = 4;           ///< per path leg (waypoint to waypoint); then the mission aborts
  double wait_s = 1.0;        ///< [s] standing still first: people walk on
  double back_off_m = 0.6;    ///< [m]
  double back_off_mps = 0.2;  ///< [m/s]
  double spin_rad = degToRad(90.0);    ///< [rad] every second attempt turns on the spot instead
  double spin_radps = degToRad(23.0);  ///< [rad/s]
  double step_timeout_s = 8.0;         ///< [s] for each of these motions
};
void describe(ParamIo& io, RecoveryParams& params);

struct MissionRunnerParams {
  Footprint footprint;
  CommandMuxParams mux;
  ObstacleMemoryParams memory;
  RecoveryParams recovery;
  double standstill_mps = 0.03;             ///< [m/s] slower than this is standing
  double standstill_radps = degToRad(3.0);  ///< [rad/s]
  double lost_pose_abort_s = 60.0;          ///< [s] without a valid pose: give up
};
void describe(ParamIo& io, MissionRunnerParams& params);

/// What the rest of the program does for a mission.
class MissionHost {
 public:
  MissionHost() = default;
  MissionHost(const MissionHost&) = delete;
  MissionHost& operator=(const MissionHost&) = delete;
  virtual ~MissionHost() = default;

  virtual void takePhoto(Timestamp stamp, const Path& path, const Task& task) = 0;
  /// Called once when the task starts; then localizationReached() is asked on every step.
  virtual void requestLocalization(LocalizationMode mode) = 0;
  [[nodiscard]] virtual bool localizationReached(LocalizationMode mode) = 0;
  /// The operator's answer, if there is one. A run without operator never answers.
  [[nodiscard]] virtual std::optional<std::string> operatorAnswer(const Task& task) = 0;
};

/// What the robot knows at one step.
struct RunnerInput {
  Timestamp stamp;
  Pose2 T_map_base;                     ///< as published
  std::optional<Timestamp> pose_stamp;  ///< when T_map_base was true; empty = the robot is lost
  Pose2 T_odom_base;                    ///< smooth
  double v_mps = 0.0;
  double omega_radps = 0.0;
  const std::vector<Point2>* scan_base = nullptr;  ///< newest scan's end points; null = none yet
  std::optional<Timestamp> scan_stamp;
  Point2 p_base_laser;  ///< where the lidar sits
};

enum class RunnerState { kDriving, kInTask, kRecovering, kPaused, kDone, kAborted };
[[nodiscard]] std::string_view toString(RunnerState state);

struct RunnerOutput {
  Command command;
  RunnerState state = RunnerState::kDriving;
  CommandSource source = CommandSource::kNone;
  std::string_view limit;    ///< see CommandMux::Result
  double clearance_m = 0.0;  ///< from the footprint to the nearest known point
};

/// Drives one mission: a pure state machine stepped with data time. Emits MissionEvents (and a
/// WarningEvent per recovery). Step it at 10 to 20 Hz.
class MissionRunner {
 public:
  /// References must outlive the runner.
  MissionRunner(
      Mission mission,
      const MissionRunnerParams& params,
      Driver& driver,
      MissionHost& host,
      const Observers& observers);

  [[nodiscard]] RunnerOutput step(const RunnerInput& input);

  /// Pauses the mission with zero commands; releasing it resumes where it was.
  void setEmergencyStop(bool on) { mux_.setEmergencyStop(on); }

  [[nodiscard]] RunnerState state() const;
  [[nodiscard]] bool finished() const;
  [[nodiscard]] const std::string& abortReason() const { return abort_reason_; }
  [[nodiscard]] const Mission& mission() const { return mission_; }
  [[nodiscard]] std::size_t pathIndex() const { return path_; }
  [[nodiscard]] std::size_t waypointsReached() const { return waypoints_reached_total_; }
  [[nodiscard]] std::size_t waypointsTotal() const;
  [[nodiscard]] int recoveries() const { return recoveries_total_; }
  /// What is still ahead on the present path.
  [[nodiscard]] std::vector<Waypoint> remainingWaypoints() const;

 private:
  enum class Phase { kStartPath, kDriving, kTask, kRecovery, kDone, kAborted };
  enum class RecoveryStep { kWait, kMove };

  void lookAround(const RunnerInput& input);
  [[nodiscard]] bool hasPose(const RunnerInput& input);
  void startPath(Timestamp stamp);
  void passWaypoints(Timestamp stamp, std::size_t reached_of_goals);
  void endPath(Timestamp stamp);
  std::optional<Command> drive(const RunnerInput& input);
  std::optional<Command> runTask(const RunnerInput& input);
  std::optional<Command> recover(const RunnerInput& input);
  void finishTask(Timestamp stamp, const std::string& text);
  void enterRecovery(const RunnerInput& input, const std::string& reason);
  void abort(Timestamp stamp, const std::string& reason);
  void emit(
      Timestamp stamp,
      MissionEvent::Kind kind,
      const std::string& waypoint,
      const std::string& text) const;
  [[nodiscard]] bool stands(const RunnerInput& input) const;
  /// Gives the driver what is left of the path, with its progress checks starting afresh.
  void resumeDriving();

  Mission mission_;
  MissionRunnerParams params_;
  Driver& driver_;
  MissionHost& host_;
  const Observers& observers_;
  CommandMux mux_;
  ObstacleMemory memory_;
  std::optional<Timestamp> scan_stamp_;  // of the scan in obstacles_odom_
  std::vector<Point2> obstacles_odom_;
  std::vector<Point2> obstacles_base_;

  Phase phase_ = Phase::kStartPath;
  bool paused_ = false;
  std::size_t path_ = 0;
  std::size_t next_waypoint_ = 0;  // of the present path
  std::size_t goals_start_ = 0;    // waypoint index of the driver's first goal
  std::size_t waypoints_reached_total_ = 0;
  std::size_t task_ = 0;
  bool task_started_ = false;
  Timestamp task_since_;
  std::optional<Timestamp> standing_since_;
  int attempts_ = 0;
  int recoveries_total_ = 0;
  RecoveryStep recovery_step_ = RecoveryStep::kWait;
  bool recovery_spins_ = false;
  double spin_sign_ = 1.0;
  Timestamp recovery_since_;
  Pose2 T_odom_base_recovery_;
  std::optional<Timestamp> lost_since_;
  std::string abort_reason_;
};

}  // namespace vestibule::nav
