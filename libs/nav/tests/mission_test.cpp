#include "vestibule/nav/mission.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/geo/tangent_plane.hpp"

namespace vestibule::nav {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

geo::Site farm() {
  geo::Site site;
  site.name = "farm";
  site.datum = {36.8, -2.4, 20.0};
  site.outdoor_area = {{-50, -50}, {50, -50}, {50, 50}, {-50, 50}};
  return site;
}

constexpr const char* kHead =
    "name: round\n"
    "site: ../sites/farm.yaml\n"
    "start: {x: 1, y: 2, yaw_deg: 90}\n";

std::string problemsOf(const std::string& yaml) {
  try {
    (void)parseMission(yaml, "missions/m.yaml", farm());
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "";
}

/// Problems of a mission with one path; its body starts at line 5 of the file.
std::string problemsOfPath(const std::string& body) {
  return problemsOf(std::string(kHead) + "paths:\n" + body);
}

TEST(Mission, ReadsBothFormsOfWaypointsAndAllTasks) {
  const Mission m = parseMission(
      std::string(kHead) +
          "sim: /etc/rtk.yaml\n"
          "paths:\n"
          "  - name: to the stable\n"
          "    tolerance_m: 0.7\n"
          "    waypoints:\n"
          "      exit: [36.8001, -2.3999, 20.0, 90.0]\n"
          "      anyhow: [36.8002, -2.3999, 20.0]\n"
          "      door: {x: 12.0, y: 3.0, yaw_deg: -45, tolerance_m: 0.3, yaw_tolerance_deg: 10}\n"
          "    task: {type: switch_localization, mode: indoor, timeout_s: 12}\n"
          "  - name: feed\n"
          "    waypoints: {trough: {x: 20, y: 3}}\n"
          "    task:\n"
          "      - photo\n"
          "      - {type: wait, duration_s: 3.5}\n"
          "      - {type: input, prompt: \"full?\", default: \"yes\", timeout_s: 4}\n"
          "      - {type: photo, file: trough.png}\n",
      "missions/m.yaml",
      farm());
  EXPECT_EQ(m.name, "round");
  EXPECT_EQ(m.site_path, "sites/farm.yaml");
  EXPECT_EQ(m.sim_path, "/etc/rtk.yaml");
  EXPECT_DOUBLE_EQ(m.T_map_base_start.phi, kPi / 2.0);
  ASSERT_EQ(m.paths.size(), 2U);

  const Path& first = m.paths[0];
  ASSERT_EQ(first.waypoints.size(), 3U);
  const Waypoint& exit = first.waypoints[0];
  EXPECT_EQ(exit.name, "exit");
  EXPECT_TRUE(exit.geodetic);
  EXPECT_TRUE(exit.has_yaw);
  EXPECT_EQ(exit.source.text(), "missions/m.yaml:9");
  EXPECT_DOUBLE_EQ(exit.tolerance_m, 0.7);
  const auto enu = geo::TangentPlane(farm().datum).toEnu({36.8001, -2.3999, 20.0});
  EXPECT_NEAR(exit.T_map_base.x, enu.x(), 1e-9);
  EXPECT_NEAR(exit.T_map_base.y, enu.y(), 1e-9);
  EXPECT_NEAR(exit.T_map_base.y, 11.1, 0.05);
  EXPECT_FALSE(first.waypoints[1].has_yaw);
  const Waypoint& door = first.waypoints[2];
  EXPECT_FALSE(door.geodetic);
  EXPECT_DOUBLE_EQ(door.T_map_base.phi, -kPi / 4.0);
  EXPECT_DOUBLE_EQ(door.tolerance_m, 0.3);
  EXPECT_NEAR(door.yaw_tolerance_rad, degToRad(10), 1e-12);
  ASSERT_EQ(first.tasks.size(), 1U);
  EXPECT_EQ(first.tasks[0].type, TaskType::kSwitchLocalization);
  EXPECT_EQ(first.tasks[0].mode, LocalizationMode::kIndoor);
  EXPECT_DOUBLE_EQ(first.tasks[0].timeout_s, 12.0);

  const auto& tasks = m.paths[1].tasks;
  ASSERT_EQ(tasks.size(), 4U);
  EXPECT_EQ(tasks[0].type, TaskType::kPhoto);
  EXPECT_DOUBLE_EQ(tasks[1].duration_s, 3.5);
  EXPECT_EQ(tasks[2].default_answer, "yes");
  EXPECT_EQ(tasks[3].file, "trough.png");
}

TEST(Mission, NamesALatitudeOutOfRange) {
  EXPECT_EQ(
      problemsOfPath("  - name: p\n    waypoints:\n      a: [96.8, -2.4, 20, 0]\n"),
      "missions/m.yaml:7: paths[0].waypoints.a: latitude 96.8 deg is out of range [-90, 90]");
}

TEST(Mission, RecognisesSwappedLatitudeAndLongitude) {
  EXPECT_EQ(
      problemsOfPath("  - name: p\n    waypoints:\n      a: [-2.40001, 36.80001, 20, 0]\n"),
      "missions/m.yaml:7: paths[0].waypoints.a: latitude and longitude look swapped: did you mean "
      "[36.80001, -2.40001, ...]?");
}

TEST(Mission, RecognisesSwappedValuesAlsoWhereTheLatitudeLeavesItsRange) {
  geo::Site site = farm();
  site.datum = {-33.0, 151.0, 0.0};
  try {
    (void)parseMission(
        std::string(kHead) + "paths: [{name: p, waypoints: {a: [151.0001, -33.0001, 0]}}]\n",
        "m.yaml",
        site);
    FAIL() << "accepted";
  } catch (const ConfigError& e) {
    EXPECT_THAT(e.what(), HasSubstr("did you mean [-33.0001, 151.0001, ...]?"));
  }
}

TEST(Mission, RefusesWaypointsFarAwayOrOutsideTheOutdoorArea) {
  EXPECT_THAT(
      problemsOfPath("  - name: p\n    waypoints:\n      a: [36.9, -2.4, 20, 0]\n"),
      HasSubstr("m.yaml:7: paths[0].waypoints.a: is 11.1 km from the site's datum (36.800000, "
                "-2.400000), at most 5 km are allowed"));
  EXPECT_THAT(
      problemsOfPath("  - name: p\n    waypoints:\n      a: [36.801, -2.4, 20, 0]\n"),
      HasSubstr("m outside the site's outdoor area"));
}

TEST(Mission, ListsEveryProblemOnceInFileOrder) {
  const std::string text = problemsOf(
      "name: round\n"
      "sites: farm.yaml\n"
      "start: {x: 1}\n"
      "paths:\n"
      "  - name: p\n"
      "    waypoints: {}\n"
      "    task: dance\n"
      "  - name: p\n"
      "    waypoints:\n"
      "      a: {x: 1, y: nan}\n"
      "      a: {x: 1, y: two}\n"
      "      b: [1, 2]\n"
      "      c: here\n"
      "    task: [{type: wait, duration_s: -1}, switch_localization]\n"
      "  - waypoints: {d: {x: 0, y: 0, yaw: 3}}\n"
      "    task: {type: switch_localization, mode: inside}\n"
      "  - name: q\n"
      "    task: {type: photo, file: ../x.png}\n");
  EXPECT_EQ(
      text,
      "missions/m.yaml:1: site: missing (required)\n"
      "missions/m.yaml:2: sites: unknown key (did you mean site?)\n"
      "missions/m.yaml:3: start.y: missing (required)\n"
      "missions/m.yaml:6: paths[0].waypoints: is empty: a path needs a waypoint\n"
      "missions/m.yaml:7: paths[0].task: unknown task 'dance': must be one of wait, input, photo, "
      "switch_localization\n"
      "missions/m.yaml:8: paths[1].name: another path is called 'p'\n"
      "missions/m.yaml:10: paths[1].waypoints.a.y: must be a number, is 'nan'\n"
      "missions/m.yaml:11: paths[1].waypoints.a: given twice: waypoint names of a path must "
      "differ\n"
      "missions/m.yaml:11: paths[1].waypoints.a.y: must be a number, is 'two'\n"
      "missions/m.yaml:12: paths[1].waypoints.b: must be [lat_deg, lon_deg, alt_m, yaw_deg] (yaw "
      "optional), has 2 numbers\n"
      "missions/m.yaml:13: paths[1].waypoints.c: must be [lat_deg, lon_deg, alt_m, yaw_deg] or {x: "
      ".., y: .., yaw_deg: ..}\n"
      "missions/m.yaml:14: paths[1].task[0].duration_s = -1: must be in [0, 86400]\n"
      "missions/m.yaml:14: paths[1].task[1]: needs a mode: {type: switch_localization, mode: "
      "indoor}\n"
      "missions/m.yaml:15: paths[2].name: missing (required)\n"
      "missions/m.yaml:15: paths[2].waypoints.d.yaw: unknown key (did you mean yaw_deg?)\n"
      "missions/m.yaml:16: paths[2].task.mode: must be one of indoor, outdoor, auto, is 'inside'\n"
      "missions/m.yaml:17: paths[3].waypoints: missing (required): a path needs a waypoint\n"
      "missions/m.yaml:18: paths[3].task.file: must be a file name without folders");
}

TEST(Mission, RefusesWhatIsNoMissionAtAll) {
  EXPECT_THAT(problemsOf("- a\n- b\n"), HasSubstr("m.yaml:1: must be a mapping"));
  EXPECT_THAT(problemsOf("name: [open\n"), HasSubstr("not valid YAML"));
  EXPECT_THAT(problemsOf(std::string(kHead) + "paths: []\n"), HasSubstr("at least one path"));
  EXPECT_THAT(problemsOf(kHead), HasSubstr("paths: missing (required)"));
  EXPECT_THAT(problemsOf(""), HasSubstr("must be a mapping"));
  try {
    (void)loadMission("no/such/mission.yaml");
    FAIL() << "accepted";
  } catch (const ConfigError& e) {
    EXPECT_STREQ(e.what(), "no/such/mission.yaml: no such mission file");
  }
}

/// A 4 x 4 m room at (10, 20) in the map frame, turned by 90 degrees, with a wall through x_grid
/// = 2.
grid::OccupancyMap roomMap() {
  constexpr int kSize = 40;
  std::vector<grid::Cell> cells(kSize * kSize, grid::Cell::kFree);
  for (int iy = 0; iy < kSize; ++iy) {
    cells[static_cast<std::size_t>(iy * kSize + 20)] = grid::Cell::kOccupied;
  }
  return grid::OccupancyMap::fromCells(
      kSize, kSize, 0.1, {0.0, 0.0}, cells, {10.0, 20.0, kPi / 2.0});
}

TEST(Mission, FindsWaypointsInAndNearMappedWalls) {
  // Grid (2.05, 1) is at map (10 - 1, 20 + 2.05).
  const Mission m = parseMission(
      std::string(kHead) +
          "paths:\n"
          "  - name: p\n"
          "    waypoints:\n"
          "      inside: {x: 9.0, y: 22.05}\n"
          "      near: {x: 9.0, y: 22.5}\n"
          "      free: {x: 9.0, y: 23.5}\n"
          "      elsewhere: {x: 40.0, y: 40.0}\n",
      "m.yaml",
      farm());
  const auto messages = checkAgainstMap(m, roomMap(), 0.6);
  EXPECT_THAT(
      messages,
      ElementsAre(
          "m.yaml:7: waypoint 'inside' of path 'p' at (9.00, 22.05) m is inside a mapped obstacle; "
          "move it into free space",
          HasSubstr("m.yaml:8: waypoint 'near' of path 'p' at (9.00, 22.50) m has 0.4")));
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_THAT(messages[1], HasSubstr("the robot needs 0.60 m"));
  EXPECT_THAT(checkAgainstMap(m, roomMap(), 0.05), Not(IsEmpty()));
}

}  // namespace
}  // namespace vestibule::nav
