#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "filter_scenarios.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/metrics/statistics.hpp"

namespace vestibule::test {

/// The mean of n chi-square values of that many degrees of freedom against its 95 % bounds.
inline void expectConsistent(const std::vector<double>& nees, int dof, const std::string& what) {
  double mean = 0.0;
  for (const double v : nees) mean += v / static_cast<double>(nees.size());
  const auto n = static_cast<double>(nees.size());
  const int total = static_cast<int>(nees.size()) * dof;
  const double low = metrics::chiSquareQuantile(0.025, total) / n;
  const double high = metrics::chiSquareQuantile(0.975, total) / n;
  std::printf("  NEES %s %.2f, 95 %% bounds [%.2f, %.2f]\n", what.c_str(), mean, low, high);
  EXPECT_GE(mean, low) << what << ": less wrong than it says";
  EXPECT_LE(mean, high) << what << ": more wrong than it says";
}

/// Consistent in position and heading; few good fixes refused.
inline void expectNominal(const std::string& scenario, std::uint64_t seeds) {
  const ekf::FilterParams params = simulatedRobotFilter();
  std::vector<double> position;
  std::vector<double> yaw;
  std::vector<double> yaw_error_deg;
  std::size_t good = 0;
  std::size_t refused = 0;
  std::vector<double> errors;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const FilterDrive drive = driveFilter(scenario, seed, params);
    ASSERT_TRUE(drive.ready_s) << scenario << " seed " << seed;
    // One sample per run: samples of one run share their errors.
    const FilterDrive::Sample& end = drive.samples.back();
    position.push_back(end.nees_position);
    yaw.push_back(end.nees_yaw);
    yaw_error_deg.push_back(radToDeg(end.yaw_error_rad));
    good += drive.good_fixes;
    refused += drive.good_refused;
    for (const auto& s : drive.samples) errors.push_back(s.error_m);
  }
  const auto figures = metrics::statistics(errors);
  const double refused_share = static_cast<double>(refused) / static_cast<double>(good);
  std::printf(
      "%s, %zu seeds: error rmse %.2f, 95 %% %.2f, max %.2f m; heading at the end %.2f deg rms; "
      "good "
      "fixes refused %.2f %%\n",
      scenario.c_str(),
      static_cast<std::size_t>(seeds),
      figures.rmse,
      figures.p95,
      figures.max,
      metrics::statistics(yaw_error_deg).rmse,
      100.0 * refused_share);
  expectConsistent(position, 2, "position");
  expectConsistent(yaw, 1, "heading");
  EXPECT_LT(refused_share, 0.01) << "of good fixes";
}

inline void expectSpikeRefused(std::uint64_t seeds) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const FilterDrive drive = driveFilter("gnss_spike_700m", seed, simulatedRobotFilter());
    ASSERT_TRUE(drive.ready_s);
    for (const double at : {60.0, 100.0, 140.0}) {
      worst = std::max(worst, drive.largestStep(at - 0.1, at + 1.0));
    }
  }
  std::printf("gnss_spike_700m: largest step of the error %.3f m\n", worst);
  EXPECT_LT(worst, 0.3) << "[m]";
}

inline void expectWalkResisted(std::uint64_t seeds) {
  std::vector<double> pulls;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const FilterDrive drive = driveFilter("multipath_walk", seed, simulatedRobotFilter());
    ASSERT_TRUE(drive.ready_s);
    // Against the same run without the walk: what the walk alone does.
    const FilterDrive without = driveFilter("open_sky", seed, simulatedRobotFilter());
    double pull = 0.0;
    for (double t = 60.0; t < 125.0; t += 0.5) {
      const Pose2& a = drive.at(t).estimate;
      const Pose2& b = without.at(t).estimate;
      pull = std::max(pull, std::hypot(a.x - b.x, a.y - b.y));
    }
    pulls.push_back(pull);
  }
  const auto figures = metrics::statistics(pulls);
  std::printf("multipath_walk: pulled by median %.2f, max %.2f m\n", figures.median, figures.max);
  EXPECT_LT(figures.max, 4.0) << "[m]";
}

/// From 60 s on there are no fixes for `length_s`.
inline void expectOutage(const std::string& scenario, double length_s, std::uint64_t seeds) {
  std::vector<double> drift;
  std::vector<double> back_s;
  std::vector<double> position;
  std::vector<double> yaw;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const FilterDrive drive = driveFilter(scenario, seed, simulatedRobotFilter());
    ASSERT_TRUE(drive.ready_s);
    const auto& begin = drive.at(60.0);
    const auto& end = drive.at(60.0 + length_s - 0.1);
    position.push_back(end.nees_position);
    yaw.push_back(end.nees_yaw);
    // What the outage adds to the error, per distance driven in it.
    const double added = end.error_m - begin.error_m;
    drift.push_back(std::max(0.0, added) / std::max(1.0, end.driven_m - begin.driven_m));
    const auto firstAfter = [&](const std::vector<double>& times) {
      const auto it =
          std::find_if(times.begin(), times.end(), [&](double t) { return t > 60.0 + length_s; });
      return it == times.end() ? 1e3 : *it;
    };
    back_s.push_back(firstAfter(drive.used_s) - firstAfter(drive.offered_s));
  }
  const auto figures = metrics::statistics(drift);
  const double slowest = *std::max_element(back_s.begin(), back_s.end());
  std::printf(
      "%s: error grew by median %.2f, 95 %% %.2f %% of the distance; a fix used at most "
      "%.1f s after the first\n",
      scenario.c_str(),
      100.0 * figures.median,
      100.0 * figures.p95,
      slowest);
  expectConsistent(position, 2, "position at the end of the outage");
  expectConsistent(yaw, 1, "heading there");
  // Calibrated wheels and a heading that the receiver's velocities told to half a degree.
  if (length_s <= 60.0) {
    EXPECT_LE(figures.median, 0.01) << "of the distance";
  }
  EXPECT_LE(slowest, 5.0) << "[s]";
}

inline void expectBadReturnResisted(std::uint64_t seeds) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const FilterDrive drive = driveFilter("outage_bad_return", seed, simulatedRobotFilter());
    ASSERT_TRUE(drive.ready_s);
    worst = std::max(worst, drive.largestError(88.0, 105.0));
  }
  std::printf("outage_bad_return: largest error %.2f m (the fixes were 40 m off)\n", worst);
  EXPECT_LT(worst, 10.0) << "[m]";
}

inline void expectStandsStill(std::uint64_t seeds) {
  double worst_deg = 0.0;
  double worst_m = 0.0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const FilterDrive drive = driveFilter("stationary_10min", seed, simulatedRobotFilter());
    ASSERT_TRUE(drive.ready_s);
    const auto& end = drive.samples.back();
    const auto& begin = drive.at(end.t_s - 580.0);
    worst_deg =
        std::max(worst_deg, std::abs(radToDeg(angleDiff(end.estimate.phi, begin.estimate.phi))));
    worst_m = std::max(
        worst_m, std::hypot(end.estimate.x - begin.estimate.x, end.estimate.y - begin.estimate.y));
  }
  std::printf(
      "stationary_10min: heading moved by at most %.3f deg, position by %.2f m\n",
      worst_deg,
      worst_m);
  EXPECT_LT(worst_deg, 0.2) << "[deg] in ten minutes";
}

inline void expectBounded(const std::string& scenario, std::uint64_t seeds, double limit_m) {
  std::vector<double> errors;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const FilterDrive drive = driveFilter(scenario, seed, simulatedRobotFilter());
    ASSERT_TRUE(drive.ready_s) << scenario << " seed " << seed;
    for (const auto& s : drive.samples) errors.push_back(s.error_m);
  }
  const auto figures = metrics::statistics(errors);
  std::printf(
      "%s: error rmse %.2f, 95 %% %.2f, max %.2f m\n",
      scenario.c_str(),
      figures.rmse,
      figures.p95,
      figures.max);
  EXPECT_LT(figures.max, limit_m) << "[m]";
}

}  // namespace vestibule::test
