#include "vestibule/pipeline/seamless_estimator.hpp"

#include <algorithm>

#include "vestibule/pipeline/gnss_input.hpp"

namespace vestibule::pipeline {
namespace {

// Indoors the map pose goes to the GNSS filter this often, with errors that repeat from scan to
// scan counted once.
constexpr double kMapPosePeriod_s = 1.0;
constexpr double kMapPoseFloor_m = 0.10;
constexpr double kMapPoseFloor_rad = degToRad(1.0);

}  // namespace

PoseWithCovariance toldStart(const Pose2& T_map_base) {
  constexpr double kSigma_m = 0.15;
  constexpr double kSigma_rad = degToRad(2.0);
  return {
      T_map_base,
      Eigen::Vector3d(kSigma_m * kSigma_m, kSigma_m * kSigma_m, kSigma_rad * kSigma_rad)
          .asDiagonal()};
}

SeamlessEstimator::SeamlessEstimator(
    const Config& config,
    const geo::Site& site,
    const std::vector<grid::MapRectangle>& map_rectangles,
    const Observers& observers)
    : config_(config),
      plane_(site.datum),
      observers_(observers),
      gnss_filter_(config.ekf, config.rig, &observers),
      localizers_(config.amcl, config.seed, &observers),
      maps_(config.maps, site, map_rectangles, observers),
      manager_(config.mode_manager, site, &observers) {}

void SeamlessEstimator::start(Timestamp stamp, const PoseWithCovariance& T_map_base) {
  gnss_filter_.reset(stamp, T_map_base);
  // The given pose stands in for the first fix, so that the run starts with a published pose.
  last_fix_ = stamp;
}

void SeamlessEstimator::process(const Measurement& measurement) {
  if (const auto* wheels = std::get_if<WheelOdometry>(&measurement)) {
    onWheels(*wheels);
  } else if (const auto* imu = std::get_if<Imu>(&measurement)) {
    gnss_filter_.process(*imu);
    has_gyro_ = true;
  } else if (const auto* heading = std::get_if<Heading>(&measurement)) {
    gnss_filter_.process(*heading);
  } else if (const auto* fix = std::get_if<GnssFix>(&measurement)) {
    onFix(*fix);
  } else if (const auto* scan = std::get_if<LaserScan>(&measurement)) {
    onScan(*scan);
  }
}

void SeamlessEstimator::onWheels(const WheelOdometry& wheels) {
  gnss_filter_.process(wheels);
  time_ = gnss_filter_.time();
  const Pose2 T_odom_base = gnss_filter_.odometry().mean;
  // The particles ride on the odometry filter, whose yaw is the gyro's: wheels of a skid-steer
  // robot do not know how far it turned.
  WheelOdometry increment = wheels;
  increment.T_previous_now = between(T_odom_base_, T_odom_base);
  localizers_.process(increment, has_gyro_ ? amcl::YawSource::kGyro : amcl::YawSource::kWheels);
  T_odom_base_ = T_odom_base;

  if (gnss_filter_.ready()) {
    manager_.offerGnss({time_, gnss_filter_.pose(), T_odom_base_}, last_fix_);
  }
  manager_.step(time_, T_odom_base_);
  if (manager_.ready()) {
    const Pose2 T_map_base = manager_.published().mean;
    maps_.update(time_, {T_map_base.x, T_map_base.y}, localizers_);
  }
  seedParticles();

  if (manager_.ready()) {
    PoseEvent event;
    event.stamp = time_;
    event.source = PoseSource::kPublished;
    event.mode = manager_.mode();
    event.T = manager_.published();
    observers_.emit(event);
  }
}

void SeamlessEstimator::onFix(const GnssFix& fix) {
  const Eigen::Vector3d p_map_antenna = antennaInMap(fix, plane_);
  if (!wasUsed(gnss_filter_.process(inMap(fix, p_map_antenna)))) return;
  last_fix_ = last_fix_ ? std::max(*last_fix_, fix.stamp) : fix.stamp;
  const auto particles = localizers_.pose();
  if (!particles || !config_.amcl.gnss.enabled) return;
  localizers_.process(
      baseInMap(
          {p_map_antenna.x(), p_map_antenna.y()}, particles->mean, config_.rig.p_base_antenna),
      claimedSigma(fix, config_.ekf.gnss));
}

void SeamlessEstimator::seedParticles() {
  if (!manager_.particlesWanted()) {
    localizers_.rest();
    return;
  }
  if (const auto seed = manager_.takeSeedRequest()) (void)localizers_.seed(*seed);
}

void SeamlessEstimator::onScan(const LaserScan& scan) {
  const auto report = localizers_.process(scan);
  if (!report) return;
  const PoseWithCovariance T_map_base = *localizers_.pose();
  manager_.offerParticles({time_, T_map_base, T_odom_base_}, report->trust);

  const bool due = !last_map_pose_to_filter_ ||
                   toSeconds(scan.stamp - *last_map_pose_to_filter_) >= kMapPosePeriod_s;
  if (manager_.mode() == Mode::kIndoor && report->trusted && due) {
    PoseWithCovariance to_filter = T_map_base;
    to_filter.cov += Eigen::Vector3d(
                         kMapPoseFloor_m * kMapPoseFloor_m,
                         kMapPoseFloor_m * kMapPoseFloor_m,
                         kMapPoseFloor_rad * kMapPoseFloor_rad)
                         .asDiagonal();
    (void)gnss_filter_.processExternalPose(scan.stamp, to_filter);
    last_map_pose_to_filter_ = scan.stamp;
  }
}

}  // namespace vestibule::pipeline
