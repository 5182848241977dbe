#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include "test_files.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/pipeline/mission.hpp"

namespace vestibule::test {

/// The feeding round of the shipped farm with one receiver and one seed.
struct FarmDrive {
  std::string mission;
  double door_zone_bar_m;
  std::uint64_t seed;
};
inline void PrintTo(const FarmDrive& drive, std::ostream* out) {
  *out << drive.mission << " seed " << drive.seed;
}
inline FarmDrive rtkDrive(std::uint64_t seed) { return {"farm_feeding", 0.5, seed}; }
inline FarmDrive singlePointDrive(std::uint64_t seed) {
  return {"farm_feeding_single_point", 1.5, seed};
}
inline std::string nameOf(const testing::TestParamInfo<FarmDrive>& info) {
  return info.param.mission + "_" + std::to_string(info.param.seed);
}

/// Drives it and holds it against the bars: every waypoint in order, no collision, no step of the
/// published pose, and the error near the doors.
inline void expectGoodDrive(const FarmDrive& drive) {
  pipeline::Config config;
  config.seed = drive.seed;
  const auto setup = pipeline::loadMissionSetup(
      shipped("config/missions/" + drive.mission + ".yaml"),
      shipped("config/worlds/farm.yaml"),
      config);
  const pipeline::MissionResult result =
      pipeline::runMission(setup, config, {}, {}, [](double, double) {});

  EXPECT_TRUE(result.done) << result.abort_reason;
  EXPECT_TRUE(result.in_order);
  ASSERT_EQ(result.waypoints.size(), 14U);
  for (const auto& w : result.waypoints) EXPECT_TRUE(w.reached) << w.path << ": " << w.name;
  EXPECT_FALSE(result.collided) << "smallest clearance " << result.min_clearance_m << " m";
  EXPECT_GT(result.min_clearance_m, 0.0);
  EXPECT_GT(result.correction.pairs, 1000U);
  EXPECT_LE(result.correction.position_m, 0.05)
      << "[m] per 100 ms, at " << formatSeconds(result.correction.position_stamp);
  EXPECT_LE(radToDeg(result.correction.yaw_rad), 0.5)
      << "[deg] per 100 ms, at " << formatSeconds(result.correction.yaw_stamp);
  EXPECT_GT(result.door_zone.count, 1000U);
  EXPECT_LE(result.door_zone.max_m, drive.door_zone_bar_m) << "[m] within 10 m of a door";
  testing::Test::RecordProperty("door_zone_max_m", std::to_string(result.door_zone.max_m));
  testing::Test::RecordProperty("step_m", std::to_string(result.correction.position_m));
}

}  // namespace vestibule::test
