#include "vestibule/geo/site.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::geo {
namespace {

using ::testing::HasSubstr;

TEST(Polygon, SignedDistanceIsNegativeInside) {
  const Polygon square{{0, 0}, {10, 0}, {10, 10}, {0, 10}};
  EXPECT_TRUE(contains(square, {5, 5}));
  EXPECT_FALSE(contains(square, {11, 5}));
  EXPECT_DOUBLE_EQ(signedDistance(square, {5, 2}), -2.0);
  EXPECT_DOUBLE_EQ(signedDistance(square, {13, 14}), 5.0);
}

TEST(Site, ReadsMapsBuildingsAndDoors) {
  const auto site = parseParams<Site>(
      "name: farm\ndatum: [36.8, -2.4, 20]\n"
      "indoor_maps:\n  - {name: stable, map: stable.yaml, T_map_grid: [1, 2, 90]}\n"
      "buildings:\n  - {name: stable, outline: [[0, 0], [10, 0], [10, 5], [0, 5]]}\n"
      "doors:\n  - {name: west, from: [0, 1], to: [0, 4]}\n",
      "site.yaml");
  ASSERT_EQ(site.indoor_maps.size(), 1U);
  EXPECT_NEAR(site.indoor_maps[0].T_map_grid.phi, kPi / 2.0, 1e-12);
  EXPECT_DOUBLE_EQ(site.doors[0].centre().y, 2.5);
  EXPECT_DOUBLE_EQ(distanceToBuildings(site, {5, 1}), -1.0);
  EXPECT_DOUBLE_EQ(distanceToBuildings(site, {-3, 1}), 3.0);
}

TEST(Site, NamesEveryProblem) {
  try {
    (void)parseParams<Site>(
        "name: farm\ndatum: [136.8, -2.4, 20]\nbuildings:\n  - {name: a, outline: [[0, 0]]}\n"
        "doors:\n  - {name: w, from: [0, 1], too: [0, 4]}\n"
        "indoor_maps:\n  - {name: a, map: a.yaml, T_map_grid: [0, 0, 0]}\n"
        "  - {name: a, map: b.yaml, T_map_grid: [9, 0, 0]}\n",
        "site.yaml");
    FAIL() << "accepted";
  } catch (const ConfigError& e) {
    EXPECT_THAT(e.what(), HasSubstr("site.yaml:2: datum: must be [lat_deg, lon_deg, height_m]"));
    EXPECT_THAT(e.what(), HasSubstr("site.yaml:4: buildings[0].outline: needs at least 3 corners"));
    EXPECT_THAT(e.what(), HasSubstr("doors[0].to: missing"));
    EXPECT_THAT(e.what(), HasSubstr("indoor_maps: two maps have the name 'a'"));
    EXPECT_THAT(e.what(), HasSubstr("doors[0].too: unknown key (did you mean to?)"));
  }
}

}  // namespace
}  // namespace vestibule::geo
