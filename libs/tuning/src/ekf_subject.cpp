#include <algorithm>
#include <cmath>
#include <map>

#include "drive_list.hpp"
#include "filter_replay.hpp"
#include "kinds.hpp"
#include "scenario_drive.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/metrics/statistics.hpp"
#include "vestibule/pipeline/time_ordered_queue.hpp"
#include "vestibule/tuning/measures.hpp"

namespace vestibule::tuning {
namespace {

/// A window whose last fix is further than this share of its length from its end says nothing of
/// the end.
constexpr double kEndShare = 0.1;

struct Drive {
  std::string name;
  Blocks blocks = Blocks::kAll;
  std::optional<SensorRig> rig;  ///< of a simulated robot; else the configuration's
  std::shared_ptr<const FilterLog> log;
  metrics::Trajectory reference;
};

Drive simulated(const DriveSpec& spec, const Folders& folders) {
  Drive drive;
  sim::Scenario scenario = sim::loadScenario(spec.recording->scenario, folders.scenarios);
  scenario.sim.lidar.rate_hz = 0.1;  // nobody looks at it
  ScenarioDrive driven = driveScenario(scenario, spec.seed);
  drive.reference = std::move(driven.truth);
  FilterLog log = makeFilterLog(std::move(driven.measurements));
  log.plane.emplace(scenario.world.datum);
  drive.log = std::make_shared<const FilterLog>(std::move(log));
  drive.rig = scenario.sim.rig;
  return drive;
}

FilterLog readLog(const std::string& path, const io::RecordingOptions& options) {
  const auto reader = io::openRecording(path, options);
  std::vector<Measurement> measurements;
  std::size_t wheels = 0;
  pipeline::forEachInStampOrder(
      *reader,
      [&](const Measurement& m) {
        if (std::holds_alternative<LaserScan>(m)) return;
        wheels += std::holds_alternative<WheelOdometry>(m) ? 1U : 0U;
        measurements.push_back(m);
      },
      [](double, double) {});
  if (wheels == 0) {
    throw InputError(
        path + ": no wheel odometry in it, which the filter needs (see vestibule info)");
  }
  return makeFilterLog(std::move(measurements));
}

/// Recordings by their path: one that is in several sets is read once.
using Logs = std::map<std::string, std::shared_ptr<const FilterLog>>;

Drive recorded(const DriveSpec& spec, const Session& session, const Folders& folders, Logs& logs) {
  Drive drive;
  io::RecordingOptions options;
  options.rig = session.base.rig;
  options.csv_mapping_dir = folders.csv_mappings;
  auto& log = logs[spec.recording->log];
  if (!log) log = std::make_shared<const FilterLog>(readLog(spec.recording->log, options));
  drive.log = log;
  drive.reference = referenceOf(*spec.recording, session.base.rig, folders);
  const bool needed = wants(session, Measure::kApe) || wants(session, Measure::kRpe) ||
                      wants(session, Measure::kOdometryRpe) || wants(session, Measure::kNees);
  if (needed && drive.reference.empty()) {
    throw InputError(
        spec.recording->log +
        ": the session's objectives compare with a reference, and there is none in it; give ref: "
        "in " +
        spec.recording->where.text());
  }
  return drive;
}

/// What is kept of a pass beside the numbers per block: what nobody looks at costs time.
struct Keep {
  bool trajectory = false;
  bool odometry = false;
  bool covariances = false;
};

Keep neededBy(const Session& session) {
  const bool nees = wants(session, Measure::kNees);
  return {
      nees || wants(session, Measure::kApe) || wants(session, Measure::kRpe),
      wants(session, Measure::kOdometryRpe),
      nees};
}

/// One pass of the filter over a drive, and everything that is measured of it.
class Pass {
 public:
  Pass(const pipeline::Config& config, const Drive& drive, const BlockGrid& grid, const Keep& keep)
      : drive_(drive), grid_(grid), keep_(keep), replay_(config, *drive.log) {}

  /// \param window_s  of hidden fixes in every block that counts; 0 = none
  /// \return why the run failed; empty when it did not
  std::string run(double window_s, std::uint64_t seed) {
    for (const Measurement& m : drive_.log->measurements) {
      const auto* fix = std::get_if<GnssFix>(&m);
      if (fix != nullptr && window_s > 0.0 && hidden(*fix, window_s, seed)) continue;
      const bool was_ready = replay_.ready();
      const ekf::UpdateReport report = replay_.feed(m);
      if (was_ready) innovation(stampOf(m), report);
      const auto* wheels = std::get_if<WheelOdometry>(&m);
      if (wheels == nullptr || replay_.time() != wheels->stamp) continue;
      if (keep_.odometry) odometry.push_back({wheels->stamp, replay_.odometry()});
      if (!replay_.ready()) continue;
      if (!replay_.poseIsFinite()) return "the pose is not finite";
      if (keep_.trajectory) trajectory.push_back({wheels->stamp, replay_.pose().mean});
      if (keep_.covariances) covariances.push_back(replay_.pose().cov);
    }
    if (!replay_.ready()) return "position and heading were never known: " + replay_.waitingFor();
    return "";
  }

  metrics::Trajectory trajectory;
  metrics::Trajectory odometry;
  std::vector<Eigen::Matrix3d> covariances;  ///< of the trajectory
  std::map<int, double> window_ends_m;
  BlockMeans innovations;
  BlockMeans nis;

 private:
  /// Whether the fix is hidden; the last one of a window is compared with.
  bool hidden(const GnssFix& fix, double window_s, std::uint64_t seed) {
    const int block = grid_.blockOf(fix.stamp);
    if (!counts(grid_.blocks, block) || fix.type == GnssFixType::kNone) return false;
    const double room_s = grid_.block_s - window_s;
    const double share = RandomStream(seed, "window", static_cast<std::uint64_t>(block)).uniform();
    const double at_s = toSeconds(fix.stamp - grid_.first) - block * grid_.block_s;
    const double from_s = share * room_s;
    if (at_s < from_s || at_s >= from_s + window_s) return false;
    if (replay_.ready() && from_s + window_s - at_s < std::max(kEndShare * window_s, 1.5)) {
      const Point2 miss = replay_.missOf(fix);
      window_ends_m[block] = std::hypot(miss.x, miss.y);
    }
    return true;
  }

  void innovation(Timestamp stamp, const ekf::UpdateReport& report) {
    if (report.dof == 0 || !grid_.scored(stamp)) return;
    const double n = report.dof;
    // An outlier counts as if it lay on the gate.
    const double bounded = std::min(report.nis, report.gate);
    innovations.add(grid_.blockOf(stamp), 0.5 * (bounded + report.log_det) / n);
    nis.add(grid_.blockOf(stamp), bounded / n);
  }

  const Drive& drive_;
  const BlockGrid& grid_;
  Keep keep_;
  FilterReplay replay_;
};

std::vector<Score> neesScores(const Pass& pass, const Drive& drive, const BlockGrid& grid) {
  metrics::AssociationOptions association;
  association.matching = metrics::Matching::kInterpolated;
  association.max_dt = std::chrono::seconds(2);
  BlockMeans means;
  std::size_t next = 0;
  for (const metrics::Match& m :
       metrics::associate(pass.trajectory, drive.reference, association)) {
    while (pass.trajectory[next].stamp != m.stamp) ++next;
    if (!grid.scored(m.stamp)) continue;
    const auto nees = metrics::nees({m.estimate, pass.covariances[next]}, m.reference);
    if (nees) means.add(grid.blockOf(m.stamp), *nees / 3.0);
  }
  return means.means();
}

/// The path moved so that it starts where the reference does.
metrics::Trajectory laidOnStart(metrics::Trajectory path, const metrics::Trajectory& reference) {
  metrics::AssociationOptions association;
  association.matching = metrics::Matching::kInterpolated;
  association.max_dt = std::chrono::seconds(2);
  const auto matches = metrics::associate(path, reference, association);
  if (matches.empty()) return path;
  const Pose2 T_reference_odom =
      compose(matches.front().reference, inverse(matches.front().estimate));
  for (metrics::TimedPose& p : path) p.pose = compose(T_reference_odom, p.pose);
  return path;
}

class EkfSubject : public Subject {
 public:
  EkfSubject(const Session& session, const Folders& folders, const pipeline::Progress& progress)
      : session_(session) {
    Logs logs;
    for (const Role role : kRoles) {
      for (const DriveSpec& spec : drivesOf(session, role)) {
        Drive drive = spec.recording->scenario.empty() ? recorded(spec, session, folders, logs)
                                                       : simulated(spec, folders);
        drive.name = spec.name();
        drive.blocks = spec.recording->blocks;
        drives_[role].push_back(std::move(drive));
        progress(-1.0, toSeconds(drives_[role].back().log->last - drives_[role].back().log->first));
      }
    }
  }

  [[nodiscard]] std::size_t drives(Role role) const override {
    const auto it = drives_.find(role);
    return it == drives_.end() ? 0 : it->second.size();
  }
  [[nodiscard]] std::string name(Role role, std::size_t drive) const override {
    return at(role, drive).name;
  }
  [[nodiscard]] double seconds(Role role, std::size_t drive) const override {
    return toSeconds(at(role, drive).log->last - at(role, drive).log->first);
  }
  [[nodiscard]] bool random() const override { return wants(session_, Measure::kHiddenOutage); }

  [[nodiscard]] Outcome run(
      const pipeline::Config& config,
      Role role,
      std::size_t index,
      std::uint64_t seed,
      const std::string& folder) const override {
    const Drive& drive = at(role, index);
    const BlockGrid grid{drive.log->first, session_.block_s, drive.blocks};
    const pipeline::Config robot = ofRobot(config, drive);
    Keep keep = neededBy(session_);
    keep.trajectory = keep.trajectory || !folder.empty();
    // One pass per length of window; everything else is measured in the first.
    std::map<double, std::unique_ptr<Pass>> passes;
    const Pass* first = nullptr;
    Outcome outcome;
    const auto pass = [&](double window_s) -> const Pass& {
      auto& slot = passes[window_s];
      if (!slot) {
        slot = std::make_unique<Pass>(robot, drive, grid, keep);
        const std::string failure = slot->run(window_s, seed);
        if (outcome.failure.empty()) outcome.failure = failure;
        if (first == nullptr) first = slot.get();
      }
      return *slot;
    };
    for (const Objective& o : session_.objectives) {
      if (o.measure == Measure::kHiddenOutage) (void)pass(o.length_s);
    }
    if (first == nullptr) first = &pass(0.0);
    if (!outcome.failure.empty()) return outcome;
    if (!folder.empty()) writeTrajectory(first->trajectory, folder);
    for (const Objective& o : session_.objectives) {
      outcome.objectives.push_back(
          scores(o, o.measure == Measure::kHiddenOutage ? pass(o.length_s) : *first, drive, grid));
    }
    return outcome;
  }

  [[nodiscard]] Paths paths(
      const pipeline::Config& config, Role role, std::size_t index) const override {
    const Drive& drive = at(role, index);
    const BlockGrid grid{drive.log->first, session_.block_s, Blocks::kAll};
    Keep keep;
    keep.trajectory = true;
    keep.odometry = true;
    Pass pass(ofRobot(config, drive), drive, grid, keep);
    (void)pass.run(0.0, 0);
    if (!measuresOdometryAlone(session_)) return {std::move(pass.trajectory), drive.reference};
    return {laidOnStart(std::move(pass.odometry), drive.reference), drive.reference};
  }

 private:
  [[nodiscard]] const Drive& at(Role role, std::size_t drive) const {
    return drives_.at(role)[drive];
  }

  static pipeline::Config ofRobot(const pipeline::Config& config, const Drive& drive) {
    pipeline::Config result = config;
    if (drive.rig) result.rig = *drive.rig;
    return result;
  }

  static std::vector<Score> scores(
      const Objective& o, const Pass& pass, const Drive& drive, const BlockGrid& grid) {
    switch (o.measure) {
      case Measure::kInnovation:
        return pass.innovations.means();
      case Measure::kNis:
        return pass.nis.means();
      case Measure::kNees:
        return neesScores(pass, drive, grid);
      case Measure::kApe:
        return apeScores(pass.trajectory, drive.reference, grid);
      case Measure::kRpe:
        return rpeScores(pass.trajectory, drive.reference, o.step_s, grid);
      case Measure::kOdometryRpe:
        return rpeScores(pass.odometry, drive.reference, o.step_s, grid);
      case Measure::kHiddenOutage: {
        std::vector<Score> ends;
        for (const auto& [block, end_m] : pass.window_ends_m) ends.push_back({block, end_m});
        return ends;
      }
      default:
        return {};
    }
  }

  const Session& session_;
  std::map<Role, std::vector<Drive>> drives_;
};

}  // namespace

std::unique_ptr<Subject> makeEkfSubject(
    const Session& session, const Folders& folders, const pipeline::Progress& progress) {
  return std::make_unique<EkfSubject>(session, folders, progress);
}

}  // namespace vestibule::tuning
