#include "vestibule/pipeline/localize.hpp"

#include <algorithm>
#include <cmath>

#include "geo_hints.hpp"
#include "vestibule/amcl/localizer.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/ekf/filter.hpp"

namespace vestibule::pipeline {
namespace {

// What a person who types or clicks a start pose is good for.
constexpr double kInitSigma_m = 0.25;
constexpr double kInitSigma_rad = degToRad(8.0);

/// Wheels alone, or once there is a gyro in the recording the odometry filter, whose turns are the
/// gyro's: the wheels of a skid-steer robot do not know how far it turned.
class GyroOdometry {
 public:
  explicit GyroOdometry(const ekf::FilterParams& params) : filter_(params, SensorRig()) {}

  WheelOdometry process(const WheelOdometry& wheels) {
    filter_.process(wheels);
    WheelOdometry odometry = wheels;
    const Pose2 now = filter_.odometry().mean;
    if (has_gyro_) {
      odometry.stamp = filter_.time();
      odometry.T_previous_now = between(T_odom_base_, now);
    }
    T_odom_base_ = now;
    return odometry;
  }
  void process(const Imu& imu) {
    filter_.process(imu);
    if (!has_gyro_) T_odom_base_ = filter_.odometry().mean;
    has_gyro_ = true;
  }
  [[nodiscard]] amcl::YawSource yawSource() const {
    return has_gyro_ ? amcl::YawSource::kGyro : amcl::YawSource::kWheels;
  }

 private:
  ekf::MapFilter filter_;
  Pose2 T_odom_base_;
  bool has_gyro_ = false;
};

// Farther than this in one step, and faster, goes no ground robot: its odometry began anew.
constexpr double kLeap_m = 3.0;
constexpr double kFastest_mps = 20.0;
// Beyond this a start pose is a mistake, and single precision ends.
constexpr double kFarFromMap_m = 1e5;

/// Tells steps of the odometry that no robot makes, as when it is set to zero on the way. They are
/// left out: the robot stays where the map has it.
class LeapGuard {
 public:
  explicit LeapGuard(const Observers& observers) : observers_(observers) {}

  [[nodiscard]] bool passes(const WheelOdometry& odometry) {
    const double since_s = began_ ? std::abs(toSeconds(odometry.stamp - last_)) : 0.0;
    last_ = odometry.stamp;
    began_ = true;
    const double limit_m = kLeap_m + kFastest_mps * since_s;
    const double step_m = translationNorm(odometry.T_previous_now);
    if (!(step_m > limit_m)) return true;
    observers_.emit(WarningEvent{
        odometry.stamp, "odometry", "leaps farther than any robot: left out", step_m, limit_m});
    return false;
  }

 private:
  const Observers& observers_;
  Timestamp last_;
  bool began_ = false;
};

std::optional<grid::PosePrior> priorFrom(const StartHints& hints) {
  if (!hints.near && !hints.heading) return std::nullopt;
  grid::PosePrior prior;
  prior.max_d2 = kHintMaxD2;
  if (hints.near) {
    prior.T_map_base.x = hints.near->p_map.x;
    prior.T_map_base.y = hints.near->p_map.y;
    const double information = 1.0 / (hints.near->sigma_m * hints.near->sigma_m);
    prior.information(0, 0) = information;
    prior.information(1, 1) = information;
  }
  if (hints.heading) {
    prior.T_map_base.phi = hints.heading->yaw_rad;
    prior.information(2, 2) = 1.0 / (hints.heading->sigma_rad * hints.heading->sigma_rad);
  }
  return prior;
}

/// The zone along the axes of the map's cells, or what covers it where these are turned.
std::optional<grid::SearchWindow> windowFrom(
    const StartHints& hints, const grid::OccupancyMap& map) {
  if (!hints.zone) return std::nullopt;
  const Point2& low = hints.zone->low;
  const Point2& high = hints.zone->high;
  const double half_x = 0.5 * (high.x - low.x);
  const double half_y = 0.5 * (high.y - low.y);
  const double c = std::abs(std::cos(map.T_map_grid().phi));
  const double s = std::abs(std::sin(map.T_map_grid().phi));
  return grid::SearchWindow{
      {0.5 * (low.x + high.x), 0.5 * (low.y + high.y), 0.0},
      c * half_x + s * half_y,
      s * half_x + c * half_y};
}

}  // namespace

LocalizeResult localize(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const std::shared_ptr<const grid::OccupancyMap>& map,
    const std::optional<Pose2>& T_map_base_init,
    const Config& config,
    const Observers& observers,
    const Progress& progress,
    const StartHints& hints,
    const std::optional<io::MapGeoreference>& georeference) {
  const auto reader = io::openRecording(recording_path, recording_options);
  amcl::Localizer localizer(config.amcl, map, config.seed, &observers);
  double outside_m = 0.0;  // of the map, the start pose
  if (T_map_base_init) {
    const Eigen::Matrix3d cov = Eigen::Vector3d(
                                    kInitSigma_m * kInitSigma_m,
                                    kInitSigma_m * kInitSigma_m,
                                    kInitSigma_rad * kInitSigma_rad)
                                    .asDiagonal();
    localizer.startAt({*T_map_base_init, cov});
    outside_m = map->rectangle().outside({T_map_base_init->x, T_map_base_init->y});
    if (!(outside_m <= kFarFromMap_m)) {
      throw ConfigError(
          "the start pose is " + std::to_string(outside_m) +
          " m outside of the map; give it in the map's frame");
    }
  } else {
    localizer.startAnywhere(priorFrom(hints), windowFrom(hints, *map));
  }

  LocalizeResult result;
  std::size_t odometry_count = 0;
  double odometry_m = 0.0;
  std::size_t trusted_count = 0;
  double inlier_sum = 0.0;
  double particle_sum = 0.0;
  double lost_sum = 0.0;
  std::optional<Timestamp> first;
  std::optional<Timestamp> last;
  GyroOdometry odometry_source(config.ekf);
  LeapGuard leaps(observers);
  GeoHints geo(config, *map, georeference, observers);
  while (const auto record = reader->next()) {
    if (const auto* wheels = std::get_if<WheelOdometry>(&record->measurement)) {
      ++odometry_count;
      if (!leaps.passes(*wheels)) continue;
      const WheelOdometry odometry = odometry_source.process(*wheels);
      localizer.process(odometry, odometry_source.yawSource());
      odometry_m += translationNorm(odometry.T_previous_now);
    } else if (const auto* imu = std::get_if<Imu>(&record->measurement)) {
      odometry_source.process(*imu);
    } else if (const auto* fix = std::get_if<GnssFix>(&record->measurement)) {
      geo.process(*fix, reader->rig().p_base_antenna, localizer);
    } else if (const auto* heading = std::get_if<Heading>(&record->measurement)) {
      geo.process(*heading, localizer);
    } else if (const auto* scan = std::get_if<LaserScan>(&record->measurement)) {
      if (!first && outside_m > 0.0) {
        observers.emit(WarningEvent{
            scan->stamp, "amcl", "the start pose is outside of the map", outside_m, 0.0});
      }
      const amcl::ScanReport report = localizer.process(*scan);
      const Pose2 T_map_base = report.T_map_base.mean;  // at the scan's stamp
      if (!result.trajectory.empty()) {
        result.distance_m += distance(result.trajectory.back().pose, T_map_base);
      }
      result.trajectory.push_back({scan->stamp, T_map_base});
      if (!localizer.searching() && result.searching_scans + 1 == result.trajectory.size()) {
        result.found_after_m = odometry_m;
        result.found_at = scan->stamp;
      }
      if (localizer.searching()) ++result.searching_scans;
      if (report.used) {
        ++result.scans_used;
        particle_sum += static_cast<double>(report.particles);
        result.largest_particle_count = std::max(result.largest_particle_count, report.particles);
      }
      trusted_count += report.trusted ? 1U : 0U;
      inlier_sum += report.inlier_share;
      result.final_trust = report.trust;
      result.final_lost_probability = report.lost_probability;
      lost_sum += report.lost_probability;
      result.trusted_at_end = report.trusted;
      first = first ? std::min(*first, scan->stamp) : scan->stamp;
      last = last ? std::max(*last, scan->stamp) : scan->stamp;
      progress(reader->progress(), toSeconds(scan->stamp - *first));
    }
  }
  result.recoveries = localizer.recoveries();
  result.searches = localizer.searches();
  result.final_state = std::string(amcl::toString(localizer.state()));
  result.geo = geo.use();
  result.notes = reader->notes();
  const std::vector<std::string> geo_notes = geo.notes();
  result.notes.insert(result.notes.end(), geo_notes.begin(), geo_notes.end());
  if (result.trajectory.empty()) {
    throw InputError(
        recording_path + ": no laser scan in it, which localization needs (see vestibule info)");
  }
  if (odometry_count == 0) {
    throw InputError(
        recording_path +
        ": no wheel odometry in it, which localization needs (see vestibule info)");
  }
  result.final_pose = localizer.pose();
  for (const amcl::Place& place : localizer.places()) {
    result.final_places.emplace_back(place.T_map_base, place.weight);
  }
  const auto n = static_cast<double>(result.trajectory.size());
  result.trusted_share = static_cast<double>(trusted_count) / n;
  result.mean_inlier_share = inlier_sum / n;
  result.mean_lost_probability = lost_sum / n;
  result.mean_particle_count =
      result.scans_used > 0 ? particle_sum / static_cast<double>(result.scans_used) : 0.0;
  result.data_s = toSeconds(*last - *first);
  return result;
}

}  // namespace vestibule::pipeline
