// The other shipped missions, one seed each, in closed loop: into buildings and out again in every
// kind of world.

#include <gtest/gtest.h>

#include <ostream>

#include "test_files.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/pipeline/mission.hpp"

namespace vestibule::test {
namespace {

struct ShippedMission {
  std::string name;
  std::string world;
};
void PrintTo(const ShippedMission& mission, std::ostream* out) { *out << mission.name; }

std::string nameOf(const testing::TestParamInfo<ShippedMission>& info) { return info.param.name; }

class Missions : public testing::TestWithParam<ShippedMission> {};

TEST_P(Missions, AreDrivenToTheirEnd) {
  const pipeline::Config config;
  const auto setup = pipeline::loadMissionSetup(
      shipped("config/missions/" + GetParam().name + ".yaml"),
      shipped("config/worlds/" + GetParam().world + ".yaml"),
      config);
  const pipeline::MissionResult result =
      pipeline::runMission(setup, config, {}, {}, [](double, double) {});
  EXPECT_TRUE(result.done) << result.abort_reason;
  EXPECT_TRUE(result.in_order);
  EXPECT_FALSE(result.collided) << "smallest clearance " << result.min_clearance_m << " m";
  EXPECT_LE(result.correction.position_m, 0.05)
      << "[m] per 100 ms, at " << formatSeconds(result.correction.position_stamp);
  EXPECT_LE(radToDeg(result.correction.yaw_rad), 0.5)
      << "[deg] per 100 ms, at " << formatSeconds(result.correction.yaw_stamp);
  EXPECT_LE(result.error.max_m, 1.0) << "[m] of the published pose";
  testing::Test::RecordProperty("error_max_m", std::to_string(result.error.max_m));
}

INSTANTIATE_TEST_SUITE_P(
    Shipped,
    Missions,
    testing::Values(
        ShippedMission{"farm_both_stables", "farm"},
        ShippedMission{"campus_delivery", "campus"},
        ShippedMission{"warehouse_docks", "warehouse_yard"},
        ShippedMission{"town_errand", "small_town"},
        ShippedMission{"office_mail", "office"},
        ShippedMission{"obstacle_course", "obstacle_course"}),
    nameOf);

}  // namespace
}  // namespace vestibule::test
