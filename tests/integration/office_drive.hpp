#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "test_files.hpp"
#include "vestibule/amcl/particle_localizer.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/ekf/filter.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/metrics/statistics.hpp"
#include "vestibule/sim/scenario.hpp"

namespace vestibule::test {

/// How the particle localization did on a simulated drive in its changed prior map.
struct OfficeResult {
  std::vector<double> errors_m;  ///< one per scan
  std::vector<double> nees;      ///< one per second, so that they are nearly independent
  double longest_loss_s = 0.0;   ///< longest time farther than 0.5 m off
};

/// Drives a scenario and localizes by scans, wheels and gyro, each when it arrives. The map stands
/// where it truly stands: what is measured is the localization, not the survey of the site.
inline OfficeResult driveOffice(const std::string& name, std::uint64_t seed) {
  const sim::Scenario scenario = sim::loadScenario(name, shipped("config/scenarios"));
  const geo::Site site = geo::loadSite(*scenario.site_path);
  const auto map = std::make_shared<const grid::OccupancyMap>(
      io::loadMap(site.indoor_maps.at(0).yaml_path)
          .movedBy(scenario.world.given_maps.at(0).T_map_grid));
  sim::ScenarioRun run(scenario, seed);
  amcl::ParticleLocalizer localizer({}, map, seed);
  localizer.initialise(
      {scenario.T_map_base_start, Eigen::Vector3d(0.02, 0.02, 0.001).asDiagonal()});
  ekf::MapFilter odometry{ekf::FilterParams{}, SensorRig{}};
  Pose2 T_odom_base;
  std::vector<std::pair<Timestamp, Pose2>> truth;
  const auto remember = [&] {
    truth.emplace_back(run.simulator().time(), run.simulator().truth());
  };
  remember();
  OfficeResult result;
  Timestamp last_nees = run.simulator().time();
  bool lost = false;
  Timestamp lost_since{};
  while (!run.finished()) {
    const auto arrived = run.step(std::chrono::milliseconds(10));
    remember();
    for (const sim::Delivered& delivered : arrived) {
      if (const auto* wheels = std::get_if<WheelOdometry>(&delivered.measurement)) {
        odometry.process(*wheels);
        WheelOdometry increment = *wheels;
        increment.stamp = odometry.time();
        increment.T_previous_now = between(T_odom_base, odometry.odometry().mean);
        T_odom_base = odometry.odometry().mean;
        localizer.process(increment, amcl::YawSource::kGyro);
      } else if (const auto* imu = std::get_if<Imu>(&delivered.measurement)) {
        odometry.process(*imu);
      } else if (const auto* scan = std::get_if<LaserScan>(&delivered.measurement)) {
        const PoseWithCovariance T = localizer.process(*scan).T_map_base;
        const auto after = std::lower_bound(
            truth.begin(), truth.end(), scan->stamp, [](const auto& t, Timestamp stamp) {
              return t.first < stamp;
            });
        if (after == truth.begin() || after == truth.end()) continue;
        const auto before = std::prev(after);
        const double share =
            toSeconds(scan->stamp - before->first) / toSeconds(after->first - before->first);
        const Pose2 at_scan = interpolate(before->second, after->second, share);
        result.errors_m.push_back(distance(T.mean, at_scan));
        if (result.errors_m.back() > 0.5) {
          if (!lost) lost_since = scan->stamp;
          lost = true;
          result.longest_loss_s =
              std::max(result.longest_loss_s, toSeconds(scan->stamp - lost_since));
        } else {
          lost = false;
        }
        if (toSeconds(scan->stamp - last_nees) >= 1.0) {
          last_nees = scan->stamp;
          if (const auto nees = metrics::nees(T, at_scan)) result.nees.push_back(*nees);
        }
      }
    }
  }
  return result;
}

}  // namespace vestibule::test
