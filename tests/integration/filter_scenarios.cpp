#include "filter_scenarios.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "test_files.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/ekf/filter.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/gnss_input.hpp"
#include "vestibule/sim/scenario.hpp"

namespace vestibule::test {
namespace {

constexpr Duration kTick = std::chrono::milliseconds(100);
/// A multipath walk or an outage ends; the receiver's errors need this long to be usual again.
constexpr double kAfterIncident_s = 1.0;

bool anyIncident(const sim::Scenario& scenario, double t_s) {
  return std::any_of(
      scenario.incidents.begin(), scenario.incidents.end(), [t_s](const sim::Incident& i) {
        return t_s >= i.at_s - 0.3 && t_s <= i.at_s + i.for_s + kAfterIncident_s;
      });
}

FilterDrive::Sample compared(
    const ekf::MapFilter& filter, Timestamp now, const Pose2& truth, double driven_m) {
  FilterDrive::Sample s;
  PoseWithCovariance T = filter.pose();
  T.mean = filter.poseAt(now);
  const Eigen::Vector2d d(truth.x - T.mean.x, truth.y - T.mean.y);
  s.error_m = d.norm();
  s.yaw_error_rad = angleDiff(T.mean.phi, truth.phi);
  s.nees_position = d.dot(T.cov.topLeftCorner<2, 2>().inverse() * d);
  s.nees_yaw = s.yaw_error_rad * s.yaw_error_rad / T.cov(2, 2);
  s.driven_m = driven_m;
  s.estimate = T.mean;
  return s;
}

/// \return what became of a fix; accepted for anything else
ekf::UpdateReport feed(
    ekf::MapFilter& filter, const Measurement& m, const std::optional<geo::TangentPlane>& plane) {
  if (const auto* wheels = std::get_if<WheelOdometry>(&m)) return filter.process(*wheels);
  if (const auto* imu = std::get_if<Imu>(&m)) return filter.process(*imu);
  if (const auto* heading = std::get_if<Heading>(&m)) return filter.process(*heading);
  const auto* fix = std::get_if<GnssFix>(&m);
  if (fix == nullptr) return {};
  const Eigen::Vector3d p = fix->type == GnssFixType::kNone ? Eigen::Vector3d::Zero()
                                                            : pipeline::antennaInMap(*fix, plane);
  return filter.process(pipeline::inMap(*fix, p));
}

sim::Scenario withoutLidar(const std::string& name) {
  sim::Scenario scenario = sim::loadScenario(name, shipped("config/scenarios"));
  scenario.sim.lidar.rate_hz = 0.1;  // nobody looks at it
  return scenario;
}

}  // namespace

const FilterDrive::Sample& FilterDrive::at(double t_s) const {
  const auto it = std::lower_bound(
      samples.begin(), samples.end(), t_s, [](const Sample& s, double t) { return s.t_s < t; });
  return it == samples.end() ? samples.back() : *it;
}

double FilterDrive::largestError(double from_s, double to_s) const {
  double worst = 0.0;
  for (const Sample& s : samples) {
    if (s.t_s >= from_s && s.t_s <= to_s) worst = std::max(worst, s.error_m);
  }
  return worst;
}

double FilterDrive::largestStep(double from_s, double to_s) const {
  double worst = 0.0;
  for (const Sample& s : samples) {
    if (s.t_s >= from_s && s.t_s <= to_s) worst = std::max(worst, s.step_m);
  }
  return worst;
}

FilterDrive driveFilter(
    const std::string& name, std::uint64_t seed, const ekf::FilterParams& params) {
  const sim::Scenario scenario = withoutLidar(name);
  sim::ScenarioRun run(scenario, seed);
  const std::optional<geo::TangentPlane> plane(scenario.world.datum);
  ekf::MapFilter filter(params, scenario.sim.rig);
  FilterDrive result;
  const Timestamp start = run.simulator().time();
  std::optional<Eigen::Vector2d> error_before;
  while (!run.finished()) {
    for (const sim::Delivered& d : run.step(kTick)) {
      const bool was_ready = filter.ready();
      const ekf::UpdateReport report = feed(filter, d.measurement, plane);
      const auto* fix = std::get_if<GnssFix>(&d.measurement);
      if (fix == nullptr) continue;
      const double t_s = toSeconds(fix->stamp - start);
      if (pipeline::wasUsed(report)) result.used_s.push_back(t_s);
      if (fix->type == GnssFixType::kNone || anyIncident(scenario, t_s)) continue;
      result.offered_s.push_back(t_s);
      if (was_ready) {
        ++result.good_fixes;
        if (!pipeline::wasUsed(report)) ++result.good_refused;
      }
    }
    if (!filter.ready()) continue;
    const double t_s = run.elapsed();
    if (!result.ready_s) result.ready_s = t_s;
    const Pose2 truth = run.simulator().truth();
    auto sample = compared(filter, run.simulator().time(), truth, run.simulator().distanceDriven());
    sample.t_s = t_s;
    const Eigen::Vector2d error(sample.estimate.x - truth.x, sample.estimate.y - truth.y);
    sample.step_m = error_before ? (error - *error_before).norm() : 0.0;
    error_before = error;
    result.samples.push_back(sample);
  }
  return result;
}

EngineDifference engineDifference(const std::string& name, double seconds) {
  const sim::Scenario scenario = withoutLidar(name);
  sim::ScenarioRun run(scenario, 1);
  const std::optional<geo::TangentPlane> plane(scenario.world.datum);
  ekf::FilterParams params = simulatedRobotFilter();
  params.engine = ekf::EngineKind::kFixed;
  ekf::MapFilter fixed(params, scenario.sim.rig);
  params.engine = ekf::EngineKind::kMrpt;
  ekf::MapFilter mrpt(params, scenario.sim.rig);
  EngineDifference result;
  while (!run.finished() && run.elapsed() < seconds) {
    for (const sim::Delivered& d : run.step(kTick)) {
      (void)feed(fixed, d.measurement, plane);
      (void)feed(mrpt, d.measurement, plane);
      if (!fixed.ready() || !mrpt.ready()) continue;
      ++result.compared;
      result.state =
          std::max(result.state, ekf::minus(fixed.state(), mrpt.state()).cwiseAbs().maxCoeff());
      result.covariance = std::max(
          result.covariance, (fixed.covariance() - mrpt.covariance()).cwiseAbs().maxCoeff());
    }
  }
  return result;
}

ekf::FilterParams simulatedRobotFilter() {
  return pipeline::loadConfig(shipped("config/filters/simulated_robot.yaml")).ekf;
}

}  // namespace vestibule::test
