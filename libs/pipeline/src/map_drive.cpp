#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "drive_odometry.hpp"
#include "map_journal.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/memory.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/geo/georeference.hpp"
#include "vestibule/mapping/deskew.hpp"
#include "vestibule/mapping/drive_path.hpp"
#include "vestibule/mapping/rbpf.hpp"
#include "vestibule/pipeline/gnss_input.hpp"
#include "vestibule/pipeline/map.hpp"
#include "vestibule/pipeline/time_ordered_queue.hpp"

namespace vestibule::pipeline {
namespace {

constexpr std::size_t kHeldOutScans = 200;
constexpr double kMaxGeoreferenceSigma_rad = degToRad(15.0);
constexpr double kLongestStep_m = 1e8;  // of odometry; the way around the Earth is shorter

/// Notes the stamps of the scans as they come from the file.
class ScanOrder : public io::RecordingReader {
 public:
  explicit ScanOrder(std::unique_ptr<io::RecordingReader> reader) : reader_(std::move(reader)) {}

  std::optional<io::Record> next() override {
    auto record = reader_->next();
    if (record) {
      if (const auto* scan = std::get_if<LaserScan>(&record->measurement)) {
        stamps.push_back(scan->stamp);
      }
    }
    return record;
  }
  [[nodiscard]] double progress() const override { return reader_->progress(); }
  [[nodiscard]] std::vector<std::string> notes() const override { return reader_->notes(); }
  [[nodiscard]] std::string format() const override { return reader_->format(); }
  [[nodiscard]] const SensorRig& rig() const override { return reader_->rig(); }

  std::vector<Timestamp> stamps;

 private:
  std::unique_ptr<io::RecordingReader> reader_;
};

/// A fix and where the robot was then: at a scan, and what the odometry says since.
struct FixAt {
  GnssFix fix;
  std::size_t scan = 0;
  Pose2 T_scan_base;
};

std::uint64_t identityOf(
    const std::string& path, const MapDriveOptions& options, const Config& config) {
  Config same = config;
  same.mapping.filter.threads = 0;  // the result does not depend on it
  same.mapping.finish.threads = 0;
  std::string text = dumpParams(same);
  std::error_code error;
  text += std::to_string(std::filesystem::file_size(path, error));
  text += " " + std::to_string(options.before.size());
  if (options.T_map_base_init) text += " " + options.T_map_base_init->asString();
  return derivedSeed(config.seed, text);
}

mapping::PatchMap mapOf(const std::vector<io::MapFrame>& frames, const Config& config) {
  std::vector<mapping::PosedScan> scans;
  scans.reserve(frames.size());
  for (const io::MapFrame& f : frames) scans.push_back({&f.scan, f.T_map_base});
  return mapping::mapOf(scans, config.mapping.filter.map);
}

/// Which sessions made which cell of a map.
/// \param map  of all frames
mapping::SessionCells sessionsOf(
    const std::vector<io::MapFrame>& frames,
    const mapping::PatchMap& map,
    const grid::OccupancyMap& drawn,
    const Config& config) {
  std::map<int, std::vector<mapping::PosedScan>> scans;
  for (const io::MapFrame& f : frames) scans[f.session].push_back({&f.scan, f.T_map_base});
  std::map<int, mapping::PatchMap> maps;
  for (const auto& [session, some] : scans) {
    maps.emplace(
        session, scans.size() == 1 ? map : mapping::mapOf(some, config.mapping.filter.map));
  }
  return mapping::sessionCells(std::move(maps), drawn);
}

/// One drive on its way through the filter.
class Drive {
 public:
  Drive(
      const std::string& path,
      const io::RecordingOptions& recording_options,
      const MapDriveOptions& options,
      const Config& config,
      const Observers& observers,
      const Progress& progress)
      : path_(path),
        options_(options),
        config_(config),
        progress_(progress),
        with_gyro_(hasGyro(path, recording_options)),
        reader_(io::openRecording(path, recording_options)),
        odometry_(config, with_gyro_),
        filter_(std::in_place, config.mapping.filter, config.seed, &observers) {
    if (!options_.journal.empty()) {
      journal_.emplace(
          options_.journal,
          identityOf(path, options, config),
          static_cast<std::size_t>(config.mapping.filter.particles),
          options_.resume);
      filter_->repeat(journal_->takeRecorded());
    }
  }

  MapDriveResult run() {
    try {
      if (with_gyro_) {
        forEachInStampOrder(
            reader_, [this](const Measurement& m) { process(m); }, [](double, double) {});
      } else {
        // Stamps may run backwards; the order of the file is the order of the drive.
        while (const auto record = reader_.next()) process(record->measurement);
      }
    } catch (const InputError& error) {
      if (filter_->generations().size() < 2) throw;  // nothing worth keeping
      damage_ = error.what();
    }
    if (nodes_.empty()) {
      throw InputError(path_ + ": no laser scan in it, nothing to map (see vestibule info)");
    }
    if (!odometry_.any()) {
      throw InputError(
          path_ + ": no wheel odometry in it, which mapping needs (see vestibule info)");
    }
    if (!any_echo_) {
      throw InputError(
          path_ +
          ": no beam of its scans met anything within the laser's range, nothing to map (see "
          "vestibule info)");
    }
    return result();
  }

 private:
  void process(const Measurement& measurement) {
    if (const auto* wheels = std::get_if<WheelOdometry>(&measurement)) {
      const double step_m = translationNorm(wheels->T_previous_now);
      if (!(step_m < kLongestStep_m)) {
        throw InputError(
            path_ + ": the odometry jumps by " + std::to_string(step_m) + " m at " +
            formatSeconds(wheels->stamp) +
            " s; the recording is damaged there: cut it out or get another copy");
      }
      odometry_.process(*wheels);
    } else if (const auto* imu = std::get_if<Imu>(&measurement)) {
      odometry_.process(*imu);
    } else if (const auto* fix = std::get_if<GnssFix>(&measurement)) {
      if (!options_.georeference || nodes_.empty() || fix->type == GnssFixType::kNone) return;
      fixes_.push_back(
          {*fix, nodes_.size() - 1, between(nodes_.back().T_odom_base, odometry_.at(fix->stamp))});
    } else if (const auto* scan = std::get_if<LaserScan>(&measurement)) {
      process(*scan);
    }
  }

  void process(const LaserScan& raw) {
    for (std::size_t i = 0; i < raw.ranges_m.size() && !any_echo_; ++i) any_echo_ = raw.valid(i);
    mapping::ScanNode node;
    node.scan = mapping::deskewed(raw, odometry_.speed(), odometry_.yawRate());
    node.T_odom_base = odometry_.at(raw.stamp);
    if (nodes_.empty()) begin(node.scan);
    const mapping::MapReport report = filter_->process(node.scan, node.T_odom_base);
    first_ = nodes_.empty() ? raw.stamp : std::min(first_, raw.stamp);
    last_ = nodes_.empty() ? raw.stamp : std::max(last_, raw.stamp);
    nodes_.push_back(std::move(node));
    if (report.repeated) {
      ++repeated_;
    } else if (report.used) {
      if (journal_) journal_->append(filter_->generations().back());
      if (options_.status) options_.status(report.effective_particles);
    }
    if (options_.preview_scans > 0 && options_.preview &&
        nodes_.size() % options_.preview_scans == 0) {
      options_.preview(
          mapping::toOccupancyMap(filter_->bestMap(), config_.mapping.known_poses.margin_m),
          soFar());
    }
    progress_(reader_.progress(), toSeconds(raw.stamp - first_));
  }

  /// Where the drive starts in the map of earlier ones.
  void begin(const LaserScan& scan) {
    if (options_.before.empty()) return;
    const mapping::PatchMap map = mapOf(options_.before, config_);
    std::optional<Pose2> start = options_.T_map_base_init;
    if (!start) start = mapping::findInMap(map, scan, config_.mapping.filter.matcher);
    if (!start) {
      throw InputError(
          path_ +
          ": its first scan fits nowhere in the earlier map; give the start with --init "
          "x,y,yaw_rad");
    }
    filter_->start(*start, map);
  }

  [[nodiscard]] std::vector<std::size_t> usedScans() const {
    std::vector<std::size_t> used;
    for (const mapping::Generation& g : filter_->generations()) used.push_back(g.scan);
    return used;
  }

  [[nodiscard]] metrics::Trajectory soFar() const {
    metrics::Trajectory poses;
    const auto path = filter_->bestPath();
    const auto used = usedScans();
    for (std::size_t k = 0; k < used.size(); ++k) {
      poses.push_back({nodes_[used[k]].scan.stamp, path[k]});
    }
    return poses;
  }

  MapDriveResult result() {
    std::vector<std::size_t> used = usedScans();
    const auto poses_of_all = mapping::spreadPath(nodes_, used, filter_->bestPath());
    for (std::size_t i = 0; i < nodes_.size(); ++i) nodes_[i].T_map_base = poses_of_all[i];
    std::vector<MapUpdate> updates;
    for (const mapping::Generation& g : filter_->generations()) {
      updates.push_back({nodes_[g.scan].scan.stamp, g.report});
    }
    const std::size_t patch_bytes = filter_->patchBytes();
    filter_.reset();  // what comes now needs the memory
    giveBackFreedMemory();
    std::vector<mapping::PoseConstraint> graph;
    std::optional<mapping::FinishResult> finished;
    if (options_.finish) {
      finished = finish();
      used = finished->keys;
      graph = finished->graph;
    } else {
      // A second session would move off the map that it extends.
      if (options_.before.empty()) smooth(used);
      giveBackFreedMemory();
      graph = mapping::chainOf(nodes_, used, config_.mapping.finish);
    }
    giveBackFreedMemory();
    const std::vector<mapping::ScanNode> held_out = heldOut(used);
    std::vector<io::MapFrame> frames = options_.before;
    int session = 1;
    for (const io::MapFrame& f : frames) session = std::max(session, f.session + 1);
    std::vector<Pose2> poses;
    for (const std::size_t i : used) {
      frames.push_back({nodes_[i].T_map_base, std::move(nodes_[i].scan), session});
      poses.push_back(nodes_[i].T_map_base);
    }
    for (mapping::ScanNode& node : nodes_) node.scan.ranges_m = {};  // only poses are needed now
    // Drawn anew: the particles' maps lack the free space that is far from the robot.
    const mapping::PatchMap map = mapOf(frames, config_);
    MapDriveResult r(mapping::toOccupancyMap(map, config_.mapping.known_poses.margin_m));
    r.trajectory = inFileOrder();
    r.quality =
        mapping::judgeMap(map, held_out, options_.judge.value_or(config_.mapping.filter.matcher));
    r.sessions = sessionsOf(frames, map, r.map, config_);
    r.graph_g2o = mapping::g2oOf(poses, graph);
    r.finished = std::move(finished);
    r.frames = std::move(frames);
    r.updates = std::move(updates);
    r.repeated_updates = repeated_;
    r.patch_bytes = patch_bytes;
    r.data_s = toSeconds(last_ - first_);
    for (std::size_t i = 1; i < r.trajectory.size(); ++i) {
      r.distance_m += distance(r.trajectory[i - 1].pose, r.trajectory[i].pose);
    }
    r.notes = reader_.notes();
    r.damage = damage_;
    if (options_.georeference) georeference(r);
    return r;
  }

  void smooth(const std::vector<std::size_t>& used) {
    if (options_.finishing) options_.finishing();
    mapping::smoothDrive(
        nodes_, used, config_.mapping.smooth, config_.mapping.finish, [this](double share) {
          progress_(share, toSeconds(last_ - first_));
        });
  }

  /// Corrects all nodes.
  mapping::FinishResult finish() {
    if (options_.finishing) options_.finishing();
    mapping::FinishResult finished =
        mapping::finishMap(std::move(nodes_), config_.mapping.finish, [this](double share) {
          progress_(share, toSeconds(last_ - first_));
        });
    nodes_ = std::move(finished.nodes);
    return finished;
  }

  /// The trajectory in the order of the file, also where the scans were taken in stamp order.
  [[nodiscard]] metrics::Trajectory inFileOrder() const {
    std::multimap<std::int64_t, std::size_t> by_stamp;
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      by_stamp.insert({nodes_[i].scan.stamp.ns, i});  // equal stamps keep their order
    }
    metrics::Trajectory poses;
    poses.reserve(nodes_.size());
    for (const Timestamp stamp : reader_.stamps) {
      const auto it = by_stamp.find(stamp.ns);
      if (it == by_stamp.end()) continue;
      poses.push_back({stamp, nodes_[it->second].T_map_base});
      by_stamp.erase(it);
    }
    return poses;
  }

  /// Scans that are not in the map, spread over the drive.
  [[nodiscard]] std::vector<mapping::ScanNode> heldOut(const std::vector<std::size_t>& used) const {
    std::vector<std::size_t> unused;
    std::size_t k = 0;
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (k < used.size() && used[k] == i) {
        ++k;
      } else {
        unused.push_back(i);
      }
    }
    std::vector<mapping::ScanNode> chosen;
    const std::size_t n = std::min(unused.size(), kHeldOutScans);
    for (std::size_t i = 0; i < n; ++i) chosen.push_back(nodes_[unused[i * unused.size() / n]]);
    return chosen;
  }

  void georeference(MapDriveResult& r) const {
    std::vector<geo::GeoPair> pairs;
    std::optional<geo::TangentPlane> plane;
    const Point2 antenna = reader_.rig().p_base_antenna;
    for (const FixAt& f : fixes_) {
      const auto* position = std::get_if<Geodetic>(&f.fix.position);
      if (position == nullptr) continue;
      if (!plane) plane.emplace(*position);
      const Eigen::Vector2d p_enu = antennaInMap(f.fix, plane).head<2>();
      const Point2 p_map = transform(compose(nodes_[f.scan].T_map_base, f.T_scan_base), antenna);
      pairs.push_back({p_enu, p_map, claimedSigma(f.fix, config_.ekf.gnss)});
    }
    const double per_s = static_cast<double>(pairs.size()) / std::max(r.data_s, 1.0);
    const auto fit = geo::fitGeoreference(pairs, 2.0 * config_.ekf.gnss.correlation_s * per_s);
    if (!fit) {
      throw InputError(
          path_ + ": " + std::to_string(pairs.size()) +
          " GNSS fixes with latitude and longitude near scans, too few or on too short a way for a "
          "georeference; leave --georeference out");
    }
    const double sigma_yaw_rad = std::sqrt(fit->T_map_grid.cov(2, 2));
    if (!(sigma_yaw_rad < kMaxGeoreferenceSigma_rad)) {
      throw InputError(
          path_ + ": " + std::to_string(pairs.size()) +
          " GNSS fixes near scans leave the map's heading open to +-" +
          std::to_string(std::lround(radToDeg(sigma_yaw_rad))) +
          " deg: too few good ones or on too short a way for a georeference; leave "
          "--georeference out");
    }
    r.georeference = io::MapGeoreference{plane->datum(), fit->T_map_grid.mean, fit->T_map_grid.cov};
    r.georeference_rms_m = fit->rms_m;
  }

  std::string path_;
  const MapDriveOptions& options_;
  const Config& config_;
  const Progress& progress_;
  bool with_gyro_;
  ScanOrder reader_;
  DriveOdometry odometry_;
  std::optional<mapping::Rbpf> filter_;  // until the drive is over
  std::optional<MapJournal> journal_;
  std::vector<mapping::ScanNode> nodes_;
  std::vector<FixAt> fixes_;
  std::size_t repeated_ = 0;
  std::optional<std::string> damage_;
  bool any_echo_ = false;
  Timestamp first_;
  Timestamp last_;
};

}  // namespace

MapDriveResult mapDrive(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const MapDriveOptions& options,
    const Config& config,
    const Observers& observers,
    const Progress& progress) {
  return Drive(recording_path, recording_options, options, config, observers, progress).run();
}

FramesMap mapOfFrames(const std::vector<io::MapFrame>& frames, const Config& config) {
  const mapping::PatchMap map = mapOf(frames, config);
  FramesMap result{mapping::toOccupancyMap(map, config.mapping.known_poses.margin_m), {}};
  result.sessions = sessionsOf(frames, map, result.map, config);
  return result;
}

}  // namespace vestibule::pipeline
