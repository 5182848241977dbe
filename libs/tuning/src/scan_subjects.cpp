#include <fstream>
#include <map>
#include <optional>

#include "drive_list.hpp"
#include "kinds.hpp"
#include "scenario_drive.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/io/recording_info.hpp"
#include "vestibule/metrics/relations.hpp"
#include "vestibule/pipeline/localize.hpp"
#include "vestibule/pipeline/map.hpp"

namespace vestibule::tuning {
namespace {

struct Drive {
  DriveSpec spec;
  std::string log;
  std::shared_ptr<const TemporaryRecording> simulated;  ///< what `log` names, of a scenario
  std::optional<SensorRig> rig;                         ///< of a simulated robot
  std::optional<Pose2> init;                            ///< amcl; empty = unknown
  std::shared_ptr<const grid::OccupancyMap> map;        ///< amcl
  metrics::Trajectory reference;
  std::vector<metrics::Relation> relations;
  Timestamp first;
  Timestamp last;
};

/// Relations metric per block: the error of each relation that starts in it, on average [m].
std::vector<Score> relationScores(
    const metrics::Trajectory& estimate, const Drive& drive, const BlockGrid& grid) {
  std::map<int, std::vector<metrics::Relation>> blocks;
  for (const metrics::Relation& r : drive.relations) {
    if (grid.scored(r.first)) blocks[grid.blockOf(r.first)].push_back(r);
  }
  std::vector<Score> scores;
  for (const auto& [block, relations] : blocks) {
    const metrics::RelationErrors errors = metrics::relationErrors(estimate, relations);
    if (errors.matched > 0) scores.push_back({block, errors.translation_m.mean});
  }
  return scores;
}

/// A map has no place of its own: its trajectory is moved to where it is nearest to the reference.
metrics::Trajectory laidOn(
    const metrics::Trajectory& reference, const metrics::Trajectory& estimate) {
  metrics::AssociationOptions association;
  association.matching = metrics::Matching::kInterpolated;
  association.max_dt = std::chrono::seconds(2);
  const Pose2 T = metrics::alignSe2(metrics::associate(estimate, reference, association));
  metrics::Trajectory moved = estimate;
  for (metrics::TimedPose& p : moved) p.pose = compose(T, p.pose);
  return moved;
}

/// What localization and mapping have in common: runs on a file, random, with a trajectory.
class ScanSubject : public Subject {
 public:
  ScanSubject(const Session& session, const Folders& folders) : session_(session) {
    recording_options_.csv_mapping_dir = folders.csv_mappings;
    for (const Role role : kRoles) {
      for (const DriveSpec& spec : drivesOf(session, role)) {
        drives_[role].push_back(load(spec, folders));
      }
    }
  }

  [[nodiscard]] std::size_t drives(Role role) const override {
    const auto it = drives_.find(role);
    return it == drives_.end() ? 0 : it->second.size();
  }
  [[nodiscard]] std::string name(Role role, std::size_t drive) const override {
    return at(role, drive).spec.name();
  }
  [[nodiscard]] double seconds(Role role, std::size_t drive) const override {
    return toSeconds(at(role, drive).last - at(role, drive).first);
  }
  [[nodiscard]] bool random() const override { return true; }

  [[nodiscard]] Outcome run(
      const pipeline::Config& config,
      Role role,
      std::size_t index,
      std::uint64_t seed,
      const std::string& folder) const override {
    const Drive& drive = at(role, index);
    const Product product = produced(ofRobot(config, drive), drive, seed);
    Outcome outcome;
    if (!folder.empty()) {
      writeTrajectory(product.trajectory, folder);
      if (product.map) io::saveMapServer(*product.map, folder + "/map.yaml", folder + "/map.pgm");
    }
    for (const Objective& o : session_.objectives) {
      outcome.objectives.push_back(scores(o, product, drive));
    }
    return outcome;
  }

  [[nodiscard]] Paths paths(
      const pipeline::Config& config, Role role, std::size_t index) const override {
    const Drive& drive = at(role, index);
    return {
        produced(ofRobot(config, drive), drive, session_.seeds.first).trajectory, drive.reference};
  }

 protected:
  [[nodiscard]] const Drive& at(Role role, std::size_t drive) const {
    return drives_.at(role)[drive];
  }
  [[nodiscard]] io::RecordingOptions recordingOptions(const pipeline::Config& config) const {
    io::RecordingOptions options = recording_options_;
    options.rig = config.rig;
    return options;
  }
  /// What a run leaves to be scored.
  struct Product {
    metrics::Trajectory trajectory;
    mapping::MapQuality quality;            ///< of mapping
    std::optional<grid::OccupancyMap> map;  ///< of mapping
  };
  /// Alone in its thread: candidates run side by side.
  [[nodiscard]] virtual Product produced(
      const pipeline::Config& config, const Drive& drive, std::uint64_t seed) const = 0;

  const Session& session_;

 private:
  static pipeline::Config ofRobot(const pipeline::Config& config, const Drive& drive) {
    pipeline::Config result = config;
    if (drive.rig) result.rig = *drive.rig;
    return result;
  }

  std::vector<Score> scores(const Objective& o, const Product& product, const Drive& drive) const {
    const BlockGrid grid{drive.first, session_.block_s, drive.spec.recording->blocks};
    switch (o.measure) {
      case Measure::kApe:
        return apeScores(product.trajectory, drive.reference, grid);
      case Measure::kRpe:
        return rpeScores(product.trajectory, drive.reference, o.step_s, grid);
      case Measure::kRelations:
        return relationScores(product.trajectory, drive, grid);
      case Measure::kScanLikelihood:
        return {{kWholeRun, -product.quality.held_out_log_likelihood}};
      case Measure::kWallThickness:
        return {{kWholeRun, product.quality.wall_thickness_m}};
      default:
        return {};
    }
  }

  /// What the session does not give comes with the scenario: recording, reference, the map and the
  /// start as the estimators are told them.
  void simulate(Drive& drive, const Folders& folders) const {
    const RecordingSpec& r = *drive.spec.recording;
    const sim::Scenario scenario = sim::loadScenario(r.scenario, folders.scenarios);
    ScenarioDrive driven = driveScenario(scenario, drive.spec.seed);
    drive.simulated = std::make_shared<const TemporaryRecording>(driven.measurements);
    drive.log = drive.simulated->path();
    drive.rig = scenario.sim.rig;
    if (r.ref.empty()) drive.reference = std::move(driven.truth);
    if (session_.subject != SubjectKind::kAmcl) return;
    if (!drive.init) drive.init = sim::startAsTold(scenario);
    if (drive.map) return;
    const auto site = sim::siteAsTold(scenario);
    if (!site || site->indoor_maps.size() != 1) {
      throw InputError(r.scenario + ": gives no map, or several; give map: in " + r.where.text());
    }
    const geo::IndoorMap& map = site->indoor_maps.front();
    drive.map = std::make_shared<const grid::OccupancyMap>(
        io::loadMap(map.yaml_path).movedBy(map.T_map_grid));
  }

  Drive load(const DriveSpec& spec, const Folders& folders) const {
    Drive drive;
    drive.spec = spec;
    const RecordingSpec& r = *spec.recording;
    drive.log = r.log;
    drive.init = r.init;
    drive.reference = referenceOf(r, session_.base.rig, folders);
    if (!r.map.empty()) drive.map = std::make_shared<const grid::OccupancyMap>(io::loadMap(r.map));
    if (!r.scenario.empty()) simulate(drive, folders);
    const auto info =
        io::inspectRecording(drive.log, recordingOptions(ofRobot(session_.base, drive)));
    if (!info.first || !info.last) {
      throw InputError(drive.log + ": nothing with a stamp in it (see vestibule info)");
    }
    drive.first = *info.first;
    drive.last = *info.last;
    if (!r.relations.empty()) {
      std::ifstream in(r.relations);
      drive.relations = metrics::parseRelations(in, r.relations);
    }
    if ((wants(session_, Measure::kApe) || wants(session_, Measure::kRpe)) &&
        drive.reference.empty()) {
      throw InputError(
          r.log + ": the session's objectives compare with a reference; give ref: in " +
          r.where.text());
    }
    return drive;
  }

  io::RecordingOptions recording_options_;
  std::map<Role, std::vector<Drive>> drives_;
};

class AmclSubject : public ScanSubject {
 public:
  using ScanSubject::ScanSubject;

 private:
  [[nodiscard]] Product produced(
      const pipeline::Config& config, const Drive& drive, std::uint64_t seed) const override {
    pipeline::Config seeded = config;
    seeded.seed = seed;
    seeded.amcl.threads = 1;
    auto result = pipeline::localize(
        drive.log,
        recordingOptions(config),
        drive.map,
        drive.init,
        seeded,
        Observers{},
        [](double, double) {});
    return {std::move(result.trajectory), {}, {}};
  }
};

class MappingSubject : public ScanSubject {
 public:
  using ScanSubject::ScanSubject;

 private:
  [[nodiscard]] Product produced(
      const pipeline::Config& config, const Drive& drive, std::uint64_t seed) const override {
    pipeline::Config seeded = config;
    seeded.seed = seed;
    seeded.mapping.filter.threads = 1;
    seeded.mapping.finish.threads = 1;
    // Every candidate by the same measure: a wider one would flatter its own map.
    pipeline::MapDriveOptions options;
    options.judge = session_.base.mapping.filter.matcher;
    auto result = pipeline::mapDrive(
        drive.log, recordingOptions(config), options, seeded, Observers{}, [](double, double) {});
    return {laidOn(drive.reference, result.trajectory), result.quality, std::move(result.map)};
  }
};

}  // namespace

std::unique_ptr<Subject> makeAmclSubject(const Session& session, const Folders& folders) {
  return std::make_unique<AmclSubject>(session, folders);
}

std::unique_ptr<Subject> makeMappingSubject(const Session& session, const Folders& folders) {
  return std::make_unique<MappingSubject>(session, folders);
}

std::unique_ptr<Subject> makeSubject(
    const Session& session, const Folders& folders, const pipeline::Progress& progress) {
  switch (session.subject) {
    case SubjectKind::kAmcl:
      return makeAmclSubject(session, folders);
    case SubjectKind::kMapping:
      return makeMappingSubject(session, folders);
    case SubjectKind::kEkf:
      break;
  }
  return makeEkfSubject(session, folders, progress);
}

}  // namespace vestibule::tuning
