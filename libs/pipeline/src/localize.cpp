#include "vestibule/pipeline/localize.hpp"

#include <algorithm>
#include <cmath>

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

}  // namespace

LocalizeResult localize(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const std::shared_ptr<const grid::OccupancyMap>& map,
    const std::optional<Pose2>& T_map_base_init,
    const Config& config,
    const Observers& observers,
    const Progress& progress) {
  const auto reader = io::openRecording(recording_path, recording_options);
  amcl::Localizer localizer(config.amcl, map, config.seed, &observers);
  if (T_map_base_init) {
    const Eigen::Matrix3d cov = Eigen::Vector3d(
                                    kInitSigma_m * kInitSigma_m,
                                    kInitSigma_m * kInitSigma_m,
                                    kInitSigma_rad * kInitSigma_rad)
                                    .asDiagonal();
    localizer.startAt({*T_map_base_init, cov});
  } else {
    localizer.startAnywhere();
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
  while (const auto record = reader->next()) {
    if (const auto* wheels = std::get_if<WheelOdometry>(&record->measurement)) {
      const WheelOdometry odometry = odometry_source.process(*wheels);
      localizer.process(odometry, odometry_source.yawSource());
      odometry_m += translationNorm(odometry.T_previous_now);
      ++odometry_count;
    } else if (const auto* imu = std::get_if<Imu>(&record->measurement)) {
      odometry_source.process(*imu);
    } else if (const auto* scan = std::get_if<LaserScan>(&record->measurement)) {
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
  result.notes = reader->notes();
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
