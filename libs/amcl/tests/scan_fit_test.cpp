#include "../src/scan_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace vestibule::amcl {
namespace {

constexpr double kSmall_m = 3.0;

/// 181 beams to the left half plane; what is there is at `range_m` of the direction.
template <class Range>
LaserScan scanOf(const Range& range_m) {
  LaserScan scan;
  scan.angle_min_rad = 0.0;
  scan.angle_step_rad = kPi / 180.0;
  scan.range_min_m = 0.05;
  scan.range_max_m = 10.0;
  for (int i = 0; i <= 180; ++i) {
    scan.ranges_m.push_back(
        static_cast<float>(std::min(10.0, range_m(scan.angle(static_cast<std::size_t>(i))))));
  }
  return scan;
}

/// Along a wall on the left.
LaserScan besideAWall(double off_m) {
  return scanOf([off_m](double yaw) { return off_m / std::max(1e-3, std::sin(yaw)); });
}

TEST(SpreadEnds, StrayBeamsAreNoSurface) {
  LaserScan scan = besideAWall(2.0);
  // Strays on one line with the wall, seen from the lidar: each between two good neighbours, and
  // three side by side that come nearer and nearer.
  scan.ranges_m[60] = 0.9F;
  scan.ranges_m[90] = 1.5F;
  scan.ranges_m[91] = 0.8F;
  scan.ranges_m[92] = 0.2F;
  scan.ranges_m[120] = 1.7F;
  scan.ranges_m[121] = 0.3F;
  const ScanEnds ends = spreadEnds(scan, 9.0, 0.08, 90, kSmall_m);
  EXPECT_GT(ends.p_base.size(), 60U);
  for (const Point2& p : ends.p_base) EXPECT_NEAR(p.y, 2.0, 0.05) << p.x;
}

TEST(SpreadEnds, AWallThatBeamsGrazeIsOneSurfaceFarOut) {
  const ScanEnds ends = spreadEnds(besideAWall(1.3), 9.0, 0.08, 1000, kSmall_m);
  double farthest_m = 0.0;
  for (std::size_t i = 0; i < ends.p_base.size(); ++i) {
    farthest_m = std::max(farthest_m, ends.p_base[i].x);
    if (i > 0) {
      EXPECT_EQ(ends.follows[i], 1) << ends.p_base[i].x;
    }
  }
  EXPECT_GT(farthest_m, 7.5);
}

/// A room of 8 x 6 m with a cupboard of 0.5 x 1 m in it, at (6, 3).
grid::OccupancyMap room() {
  constexpr int kW = 160;
  constexpr int kH = 120;
  std::vector<grid::Cell> cells(kW * kH, grid::Cell::kFree);
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      const bool wall = x < 2 || y < 2 || x >= kW - 2 || y >= kH - 2;
      const bool cupboard = x >= 120 && x < 130 && y >= 50 && y < 70;
      if (wall || cupboard) cells[static_cast<std::size_t>(y * kW + x)] = grid::Cell::kOccupied;
    }
  }
  return grid::OccupancyMap::fromCells(kW, kH, 0.05, {0.0, 0.0}, cells, {});
}

TEST(ScanFitter, WhatASmallThingSaysIsKeptApart) {
  const grid::OccupancyMap map = room();
  const GlobalParams params;
  const ScanFitter fitter(params, map);
  // From the middle of the room, looking at the wall behind the cupboard as if it were not there.
  LaserScan scan = scanOf([](double yaw) {
    return std::min(
        3.9 / std::max(1e-3, std::sin(yaw)), 2.9 / std::max(1e-3, std::abs(std::cos(yaw))));
  });
  const Pose2 T_map_base{4.0, 3.0, -0.5 * kPi};
  const ScanEnds ends = spreadEnds(scan, 9.0, 0.08, 90, kSmall_m);
  Views missing(params.surface_m);
  const ScanFit fit = fitter.fit(ends, {}, {}, {0.0, 0.0}, T_map_base, missing);
  EXPECT_GT(fit.inlier_share, 0.7);
  EXPECT_GT(fit.log_likelihood, -1.5);  // the walls agree, but for the cells
  std::set<std::int64_t> things;
  double says = 0.0;
  for (const ThingEvidence& e : fit.things) {
    things.insert(e.thing);
    says += e.log_likelihood;
  }
  EXPECT_EQ(things.size(), 1U);
  EXPECT_GT(*things.begin(), 0);  // a mapped one
  EXPECT_LT(says, -0.5);
}

TEST(ScanFitter, NothingNeedsToBeSmall) {
  const grid::OccupancyMap map = room();
  GlobalParams params;
  params.small_m = 0.0;
  const ScanFitter fitter(params, map);
  LaserScan scan = scanOf([](double /*yaw*/) { return 2.5; });
  scan.ranges_m[90] = scan.ranges_m[91] = 1.0F;
  const ScanEnds ends = spreadEnds(scan, 9.0, 0.08, 90, params.small_m);
  Views missing(params.surface_m);
  const ScanFit fit = fitter.fit(ends, {}, {}, {0.0, 0.0}, {3.0, 3.0, 0.0}, missing);
  EXPECT_TRUE(std::isfinite(fit.log_likelihood));
  for (const ThingEvidence& e : fit.things) EXPECT_LT(e.thing, 0);
}

}  // namespace
}  // namespace vestibule::amcl
