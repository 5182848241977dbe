#include "filter_replay.hpp"

#include <algorithm>
#include <utility>

#include "vestibule/pipeline/gnss_input.hpp"

namespace vestibule::tuning {
namespace {

/// The filter's own order of what has one stamp.
int rank(const Measurement& m) {
  if (std::holds_alternative<Imu>(m)) return 0;
  if (std::holds_alternative<Heading>(m)) return 1;
  return std::holds_alternative<WheelOdometry>(m) ? 2 : 3;
}

}  // namespace

FilterReplay::FilterReplay(const pipeline::Config& config, const FilterLog& log)
    : log_(log), filter_(config.ekf, config.rig) {
  filter_.expectOrder();
}

ekf::UpdateReport FilterReplay::feed(const Measurement& measurement) {
  if (const auto* wheels = std::get_if<WheelOdometry>(&measurement))
    return filter_.process(*wheels);
  if (const auto* imu = std::get_if<Imu>(&measurement)) return filter_.process(*imu);
  if (const auto* heading = std::get_if<Heading>(&measurement)) return filter_.process(*heading);
  const auto* fix = std::get_if<GnssFix>(&measurement);
  if (fix == nullptr || fix->type == GnssFixType::kNone) return {};
  return filter_.process(pipeline::inMap(*fix, pipeline::antennaInMap(*fix, log_.plane)));
}

bool FilterReplay::poseIsFinite() const {
  const ekf::State& x = filter_.state();
  return x.p.head<2>().allFinite() && x.q.coeffs().allFinite();
}

Pose2 FilterReplay::odometry() const { return filter_.odometry().mean; }

Point2 FilterReplay::missOf(const GnssFix& fix) const {
  const Eigen::Vector3d measured = pipeline::antennaInMap(fix, log_.plane);
  const Eigen::Vector2d expected = filter_.expected(pipeline::inMap(fix, measured)).p_map_antenna;
  return {expected.x() - measured.x(), expected.y() - measured.y()};
}

FilterLog makeFilterLog(std::vector<Measurement> measurements) {
  FilterLog log;
  log.measurements = std::move(measurements);
  log.measurements.erase(
      std::remove_if(
          log.measurements.begin(),
          log.measurements.end(),
          [](const Measurement& m) { return std::holds_alternative<LaserScan>(m); }),
      log.measurements.end());
  std::stable_sort(
      log.measurements.begin(), log.measurements.end(), [](const auto& a, const auto& b) {
        return std::make_pair(stampOf(a), rank(a)) < std::make_pair(stampOf(b), rank(b));
      });
  if (log.measurements.empty()) return log;
  log.first = stampOf(log.measurements.front());
  log.last = stampOf(log.measurements.back());
  for (const Measurement& m : log.measurements) {
    const auto* fix = std::get_if<GnssFix>(&m);
    if (fix == nullptr || fix->type == GnssFixType::kNone) continue;
    if (const auto* g = std::get_if<Geodetic>(&fix->position)) log.plane.emplace(*g);
    break;
  }
  return log;
}

}  // namespace vestibule::tuning
