#include "vestibule/sim/world.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/sim/world_geometry.hpp"

namespace vestibule::sim {
namespace {

using ::testing::HasSubstr;

WorldGeometry room(double half_x_m, double half_y_m) {
  World world;
  world.walls.push_back(
      {"room",
       {{-half_x_m, -half_y_m}, {half_x_m, -half_y_m}, {half_x_m, half_y_m}, {-half_x_m, half_y_m}},
       true});
  return WorldGeometry(world);
}

TEST(CastRay, MeetsTheWallsOfARoomExactly) {
  const WorldGeometry geometry = room(5.0, 3.0);
  for (int i = 0; i < 720; ++i) {
    const double angle_rad = i * kPi / 360.0 + 1e-4;
    const Point2 from{1.25, -0.5};
    const double c = std::cos(angle_rad);
    const double s = std::sin(angle_rad);
    const double expected_m =
        std::min(((c > 0 ? 5.0 : -5.0) - from.x) / c, ((s > 0 ? 3.0 : -3.0) - from.y) / s);
    EXPECT_NEAR(geometry.castRay(from, angle_rad, 30.0), expected_m, 1e-9) << "beam " << i;
  }
}

TEST(CastRay, DoesNotLeakThroughCornersAndStopsAtItsRange) {
  const WorldGeometry geometry = room(5.0, 5.0);
  EXPECT_NEAR(geometry.castRay({0, 0}, kPi / 4.0, 30.0), 5.0 * std::sqrt(2.0), 1e-9);
  EXPECT_DOUBLE_EQ(geometry.castRay({0, 0}, 0.0, 2.0), 2.0);
  // From outside the grid, towards it and past it.
  EXPECT_NEAR(geometry.castRay({-20, 0.3}, 0.0, 30.0), 15.0, 1e-9);
  EXPECT_DOUBLE_EQ(geometry.castRay({-20, 0.3}, kPi, 30.0), 30.0);
  EXPECT_DOUBLE_EQ(WorldGeometry(std::vector<Segment>{}).castRay({0, 0}, 1.0, 30.0), 30.0);
}

TEST(WorldGeometry, AgreesWithASearchOverAllSegments) {
  RandomStream random(7, "segments");
  std::vector<Segment> segments;
  for (int i = 0; i < 150; ++i) {
    const Point2 a{random.uniform(-20, 20), random.uniform(-15, 15)};
    segments.push_back({a, {a.x + random.normal(0, 3), a.y + random.normal(0, 3)}});
  }
  const WorldGeometry geometry(segments);
  for (int i = 0; i < 1000; ++i) {
    const Point2 p{random.uniform(-30, 30), random.uniform(-25, 25)};
    const double angle_rad = random.uniform(-kPi, kPi);
    const double c = std::cos(angle_rad);
    const double s = std::sin(angle_rad);
    double range_m = 25.0;
    double clearance_m = 1e9;
    for (const Segment& w : segments) {
      clearance_m = std::min(clearance_m, geo::distanceToSegment(p, w.a, w.b));
      // Solve p + t (c, s) = a + u (b - a).
      const double dx = w.b.x - w.a.x;
      const double dy = w.b.y - w.a.y;
      const double det = c * dy - s * dx;
      const double t = ((w.a.x - p.x) * dy - (w.a.y - p.y) * dx) / det;
      const double u = ((w.a.x - p.x) * s - (w.a.y - p.y) * c) / det;
      if (t >= 0 && u >= 0 && u <= 1) range_m = std::min(range_m, t);
    }
    EXPECT_NEAR(geometry.castRay(p, angle_rad, 25.0), range_m, 1e-6)
        << "from (" << p.x << ", " << p.y << ") at " << angle_rad;
    EXPECT_NEAR(geometry.clearance(p), clearance_m, 1e-9) << "(" << p.x << ", " << p.y << ")";
  }
}

TEST(Footprint, KnowsItsDistanceToWallsInEveryAttitude) {
  const WorldGeometry wall(std::vector<Segment>{{{2.0, -5.0}, {2.0, 5.0}}});
  EXPECT_NEAR(wall.footprintClearance({0, 0, 0}, 0.5, 0.3), 1.5, 1e-12);
  EXPECT_NEAR(wall.footprintClearance({0, 0, kPi / 2}, 0.5, 0.3), 1.7, 1e-12);
  const double reach = 0.5 * std::cos(0.4) + 0.3 * std::sin(0.4);
  EXPECT_NEAR(wall.footprintClearance({0, 0, 0.4}, 0.5, 0.3), 2.0 - reach, 1e-12);
  EXPECT_FALSE(wall.footprintCollides({1.49, 0, 0}, 0.5, 0.3));
  EXPECT_TRUE(wall.footprintCollides({1.51, 0, 0}, 0.5, 0.3));
  // A post inside the rectangle touches none of its sides.
  const WorldGeometry post(std::vector<Segment>{{{0.1, 0.0}, {0.12, 0.0}}});
  EXPECT_TRUE(post.footprintCollides({0, 0, 1.0}, 0.5, 0.3));
}

TEST(World, TurnsBoxesCirclesAndClosedDoorsIntoSegments) {
  const auto world = parseParams<World>(
      "name: w\ndatum: [36.8, -2.4, 20]\n"
      "boxes:\n  - {centre: [5, 0], size: [2, 1], yaw_deg: 90}\n"
      "circles:\n  - {centre: [0, 5], radius_m: 1}\n"
      "doors:\n  - {name: open, from: [-5, -1], to: [-5, 1]}\n"
      "  - {name: shut, from: [-1, -4], to: [1, -4], open: false}\n",
      "w.yaml");
  const WorldGeometry geometry(world);
  EXPECT_NEAR(geometry.castRay({0, 0}, 0.0, 30.0), 4.5, 1e-9);
  EXPECT_NEAR(geometry.castRay({0, 0}, kPi / 2, 30.0), 4.0, 0.01);
  EXPECT_DOUBLE_EQ(geometry.castRay({0, 0}, kPi, 30.0), 30.0);
  EXPECT_NEAR(geometry.castRay({0, 0}, -kPi / 2, 30.0), 4.0, 1e-9);
}

TEST(World, TakesTheDarkCellsOfAnImageAsWalls) {
  // GIVEN a picture of 40 x 20 cells of 0.1 m with a dark column 10 to 11
  const std::string path = ::testing::TempDir() + "sim_world.png";
  cv::Mat picture(20, 40, CV_8UC1, cv::Scalar(255));
  picture.colRange(10, 12).setTo(0);
  ASSERT_TRUE(cv::imwrite(path, picture));
  World world;
  world.occupancy_image.emplace();
  world.occupancy_image->image = path;
  world.occupancy_image->resolution_m = 0.1;
  world.occupancy_image->T_map_image = {2.0, 0.0, 0.0};
  // THEN its faces stand at 3.0 and 3.2 m, as four straight runs
  const WorldGeometry geometry(world);
  EXPECT_NEAR(geometry.castRay({2.5, 1.0}, 0.0, 30.0), 0.5, 1e-9);
  EXPECT_NEAR(geometry.castRay({5.0, 1.0}, kPi, 30.0), 1.8, 1e-9);
  EXPECT_EQ(geometry.segments().size(), 4U);

  world.occupancy_image->image = ::testing::TempDir() + "no_such_image.png";
  try {
    (void)WorldGeometry(world);
    FAIL() << "accepted a missing image";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("no_such_image.png: cannot read"));
  }
}

TEST(World, NamesEveryProblemWithItsLine) {
  try {
    (void)parseParams<World>(
        "name: farm\n"
        "datum: [136.8, -2.4, 20]\n"
        "walls:\n"
        "  - {id: a, points: [[0, 0]]}\n"
        "boxes:\n"
        "  - {id: a, centre: [0, 0], size: [1, -1]}\n"
        "circles:\n"
        "  - {center: [0, 0], radius_m: 1}\n",
        "farm.yaml");
    FAIL() << "accepted";
  } catch (const ConfigError& e) {
    EXPECT_THAT(e.what(), HasSubstr("farm.yaml:2: datum: must be [lat_deg, lon_deg, height_m]"));
    EXPECT_THAT(e.what(), HasSubstr("farm.yaml:4: walls[0].points: needs at least 2 points"));
    EXPECT_THAT(e.what(), HasSubstr("farm.yaml:6: boxes[0].size"));
    EXPECT_THAT(e.what(), HasSubstr("id a is used twice"));
    EXPECT_THAT(e.what(), HasSubstr("farm.yaml:8: circles[0].center: unknown key"));
  }
}

TEST(World, KnowsItsRoofs) {
  const auto world = parseParams<World>(
      "name: w\ndatum: [36.8, -2.4, 20]\nbuildings:\n"
      "  - {name: a, outline: [[0, 0], [10, 0], [10, 5], [0, 5]]}\n"
      "  - {name: yard, outline: [[20, 0], [30, 0], [30, 5], [20, 5]], roof: false}\n",
      "w.yaml");
  const WorldGeometry geometry(world);
  EXPECT_DOUBLE_EQ(geometry.distanceToRoofs({5, 1}), -1.0);
  EXPECT_DOUBLE_EQ(geometry.distanceToRoofs({25, 1}), 15.0);
}

/// What loadWorld says about a file with this text after name and datum.
std::string refusal(const std::string& yaml) {
  const std::string path = ::testing::TempDir() + "sim_refused.yaml";
  std::ofstream(path) << "name: w\ndatum: [36.8, -2.4, 20]\n" << yaml;
  try {
    (void)loadWorld(path);
  } catch (const std::exception& e) {
    return e.what();
  }
  return "accepted";
}

TEST(World, RefusesWhatCannotStand) {
  const std::string house =
      "buildings:\n  - {name: a, outline: [[0, 0], [8, 0], [8, 5], [0, 5]]}\n";
  EXPECT_THAT(
      refusal(house + "doors:\n  - {name: d, from: [3, 2], to: [4, 2]}\n"),
      HasSubstr("sim_refused.yaml:6: door d: is not on a wall"));
  EXPECT_EQ(refusal(house + "doors:\n  - {name: d, from: [3, 0], to: [4, 0]}\n"), "accepted");
  EXPECT_THAT(
      refusal(house + "  - {name: b, outline: [[7, 4], [12, 4], [12, 9], [7, 9]]}\n"),
      HasSubstr("sim_refused.yaml:5: building b: its roof overlaps that of a"));
  EXPECT_THAT(
      refusal(house + "  - {name: b, outline: [[1, 1], [2, 1], [2, 2], [1, 2]]}\n"),
      HasSubstr("its roof overlaps that of a"));
  EXPECT_EQ(
      refusal(house + "  - {name: b, outline: [[8, 0], [12, 0], [12, 5], [8, 5]]}\n"), "accepted")
      << "outlines may touch";
  EXPECT_THAT(
      refusal("buildings:\n  - {name: a, outline: [[0, 0], [8, 5], [8, 0], [0, 5]]}\n"),
      HasSubstr("sim_refused.yaml:4: building a: its outline crosses itself"));
  EXPECT_THAT(
      refusal("circles:\n  - {centre: [0, 0], radius_m: -1}\n"),
      HasSubstr("sim_refused.yaml:4: circles[0].radius_m"));
  const auto at_line_3 = [](const char* what) {
    return ::testing::AllOf(HasSubstr("sim_refused.yaml:3: "), HasSubstr(what));
  };
  EXPECT_THAT(
      refusal("occupancy_image: {image: nowhere.png, resolution_m: 0.05}\n"),
      at_line_3("nowhere.png: cannot read"));
  EXPECT_THAT(
      refusal("height_field: {image: nowhere.png}\n"), at_line_3("nowhere.png: no such file"));
  EXPECT_THAT(
      refusal("map_server: {yaml: nowhere.yaml}\n"), at_line_3("nowhere.yaml: no such file"));
  EXPECT_THAT(refusal("sdf: nowhere.world\n"), at_line_3("nowhere.world: no such file"));
  std::ofstream(::testing::TempDir() + "sim_bad.world") << "<sdf><nonsense></sdf>";
  EXPECT_THAT(refusal("sdf: sim_bad.world\n"), at_line_3("sim_bad.world: not a Gazebo world"));
  std::ofstream(::testing::TempDir() + "sim_bad_map.yaml")
      << "image: nowhere.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n";
  EXPECT_THAT(
      refusal("map_server: {yaml: sim_bad_map.yaml}\n"), at_line_3("nowhere.pgm: cannot read"));
  EXPECT_THAT(
      refusal("walls:\n  - {points: [[0, 0], [1, 0]], material: paper}\n"),
      HasSubstr("sim_refused.yaml:4: walls[0].material"));
  EXPECT_THAT(
      refusal("walls:\n  - {points: [[0, 0], [1, 0]], height_m: -2}\n"),
      HasSubstr("sim_refused.yaml:4: walls[0].height_m"));
  EXPECT_THAT(
      refusal("movers:\n  - {path: [[1, 1], [1, 1]]}\n"),
      HasSubstr("sim_refused.yaml:4: movers[0].path: must lead somewhere"));
  EXPECT_THAT(
      refusal("movers:\n  - {path: [[1, 1], [2, 1]], speed_mps: 0}\n"),
      HasSubstr("sim_refused.yaml:4: movers[0].speed_mps"));
  EXPECT_THAT(
      refusal("ground: {roughness_m: 3}\n"), HasSubstr("sim_refused.yaml:3: ground.roughness_m"));
  EXPECT_THAT(
      refusal("ground_areas:\n  - {outline: [[0, 0], [1, 0]]}\n"),
      HasSubstr("sim_refused.yaml:4: ground_areas[0].outline: needs at least 3 points"));
  EXPECT_THAT(
      refusal("ramps:\n  - {from: [0, 0], to: [0, 0], rise_m: 1}\n"),
      HasSubstr("sim_refused.yaml:4: ramps[0].to: must not be where"));
  EXPECT_THAT(
      refusal("plates:\n  - {outline: [[0, 0], [1, 0], [1, 1]]}\n"),
      HasSubstr("sim_refused.yaml:4: plates[0].height_m"));
  EXPECT_THAT(
      refusal(house + "doors:\n  - {name: d, from: [3, 0], to: [3, 0]}\n"),
      HasSubstr("sim_refused.yaml:6: doors[0].to: must not be where"));
  EXPECT_THAT(
      refusal(
          house + "doors:\n  - {name: d, from: [3, 0], to: [4, 0]}\n"
                  "  - {name: d, from: [5, 0], to: [6, 0]}\n"),
      HasSubstr("sim_refused.yaml:7: door d: the name is used twice"));
  EXPECT_THAT(
      refusal(
          house +
          "given_maps:\n  - {name: m, building: b, removed: [ghost], survey_paths: [{points: [[0, "
          "0], [1, 0]]}]}\n"),
      ::testing::AllOf(
          HasSubstr("sim_refused.yaml:6: given map m: removed: no object has the id ghost"),
          HasSubstr("given map m: building: no building is named b")));
  EXPECT_THAT(
      refusal(
          house + "doors:\n  - {name: d, from: [3, 0], to: [4, 0], changes: [{at_s: 9}, {at_s: "
                  "5}]}\n"),
      HasSubstr("sim_refused.yaml:6: doors[0].changes: must be in the order of time"));
}

TEST(World, DoorsSlideAndPeopleWalkByTheClock) {
  World world;
  world.doors.push_back(
      {{"gate", {5, -1}, {5, 1}}, true, 2.2, {{10.0, false, 2.0}, {20.0, true, 2.0}}, {}});
  Mover person;
  person.path = {{-5, 0}, {-15, 0}};
  person.start_s = 4.0;
  person.pause_s = 2.0;
  world.movers.push_back(person);
  const WorldGeometry geometry(world);
  const auto ahead = [&](double time_s, const Eigen::Vector3d& direction) {
    return geometry.castRay(geometry.momentAt(time_s), {0, 0.5, 0.4}, direction, 30.0).range_m;
  };
  const Eigen::Vector3d east = Eigen::Vector3d::UnitX();
  EXPECT_EQ(ahead(9.9, east), 30.0);
  EXPECT_EQ(ahead(11.0, east), 30.0) << "half closed: the leaf ends at y = 0";
  EXPECT_NEAR(ahead(11.8, east), 5.0, 1e-9) << "it ends at y = 0.8";
  EXPECT_NEAR(ahead(15.0, east), 5.0, 1e-9);
  EXPECT_EQ(ahead(22.0, east), 30.0);
  const auto person_at = [&](double time_s) {
    return geometry.castRay(geometry.momentAt(time_s), {0, 0, 0.4}, -east, 30.0).range_m;
  };
  EXPECT_NEAR(person_at(3.0), 4.75, 0.03);
  EXPECT_NEAR(person_at(9.0), 9.75, 0.03);
  EXPECT_NEAR(person_at(15.0), 14.75, 0.03) << "pauses at the end";
  EXPECT_NEAR(person_at(21.0), 9.75, 0.03) << "on its way back";
}

TEST(World, RaysKnowHeights) {
  World world;
  Wall wall{"", {{5, -5}, {5, 5}}, false, 2.0};
  world.walls.push_back(wall);
  wall.points = {{8, -5}, {8, 5}};
  wall.base_m = 1.0;
  world.walls.push_back(wall);
  const WorldGeometry geometry(world);
  const auto range = [&](double z, double climb) {
    return geometry.castRay({}, {0, 0, z}, Eigen::Vector3d(1, 0, climb).normalized(), 40.0);
  };
  EXPECT_NEAR(range(0.4, 0.0).range_m, 5.0, 1e-9);
  EXPECT_NEAR(range(2.2, 0.0).range_m, 8.0, 1e-9) << "above the first, below the top of the other";
  EXPECT_FALSE(range(3.2, 0.0).hit);
  const RayHit ground = range(0.4, -0.1);
  EXPECT_EQ(ground.material, Material::kGround);
  EXPECT_NEAR(ground.range_m, std::hypot(4.0, 0.4), 1e-9);
  // A satellite in the east: hidden by the wall up to atan((2 - 1) / 5) and by the upper one
  // between.
  EXPECT_TRUE(geometry.skyPath({}, {0, 0, 1.0}, 0.0, 0.15).wall);
  EXPECT_TRUE(geometry.skyPath({}, {0, 0, 1.0}, 0.0, 0.24).wall);
  EXPECT_FALSE(geometry.skyPath({}, {0, 0, 1.0}, 0.0, 0.30).wall);
  EXPECT_TRUE(geometry.skyPath({}, {0, 0, 1.0}, kPi, 0.15).clear());
}

TEST(World, RampsAndPlatesRaiseTheGround) {
  const auto world = parseParams<World>(
      "name: w\ndatum: [36.8, -2.4, 20]\n"
      "ramps: [{from: [2, 0], to: [6, 0], width_m: 3, rise_m: 1}]\n"
      "plates: [{outline: [[6, -2], [9, -2], [9, 2], [6, 2]], height_m: 1}]\n",
      "w.yaml");
  const WorldGeometry geometry(world);
  EXPECT_DOUBLE_EQ(geometry.groundHeight({0, 0}), 0.0);
  EXPECT_DOUBLE_EQ(geometry.groundHeight({4, 1}), 0.5);
  EXPECT_DOUBLE_EQ(geometry.groundHeight({4, 1.6}), 0.0);
  EXPECT_DOUBLE_EQ(geometry.groundHeight({8, 1}), 1.0);
  // A level beam 0.5 m high meets the ramp in its middle.
  EXPECT_NEAR(geometry.castRay({}, {0, 0, 0.5}, Eigen::Vector3d::UnitX(), 30.0).range_m, 4.0, 1e-3);
}

TEST(World, TakesTheWallsOfOtherFormats) {
  const std::string folder = ::testing::TempDir();
  cv::Mat picture(20, 40, CV_8UC1, cv::Scalar(254));
  picture.colRange(10, 12).setTo(0);
  ASSERT_TRUE(cv::imwrite(folder + "sim_import.pgm", picture));
  std::ofstream(folder + "sim_import.yaml")
      << "image: sim_import.pgm\nresolution: 0.1\norigin: [2.0, 0, 0]\nnegate: 0\n"
         "occupied_thresh: 0.65\nfree_thresh: 0.196\n";
  std::ofstream(folder + "sim_import.world") << R"(<?xml version="1.0"?>
<sdf version="1.6"><world name="w">
<model name="crate"><pose>5 0 0.5 0 0 1.5707963</pose><static>1</static><link name="l">
<collision name="c"><geometry><box><size>2 1 1</size></box></geometry></collision></link></model>
<model name="post"><pose>0 5 1 0 0 0</pose><link name="l">
<collision name="c"><geometry><cylinder><radius>1</radius><length>2</length></cylinder></geometry>
</collision></link></model>
</world></sdf>)";
  std::ofstream(folder + "sim_imports.yaml")
      << "name: w\ndatum: [36.8, -2.4, 20]\nmap_server: {yaml: sim_import.yaml, T_map_grid: [0, "
         "-20, 0]}\nsdf: sim_import.world\n";
  const WorldGeometry geometry(loadWorld(folder + "sim_imports.yaml"));
  EXPECT_NEAR(geometry.castRay({2.5, -19.0}, 0.0, 30.0), 0.5, 1e-9);
  EXPECT_NEAR(geometry.castRay({0, 0}, 0.0, 30.0), 4.5, 1e-6);
  EXPECT_NEAR(geometry.castRay({0, 0}, kPi / 2, 30.0), 4.0, 0.01);
  EXPECT_EQ(geometry.castRay({0, 0}, 0.0, 30.0, 1.5), 30.0) << "the crate is 1 m high";
}

}  // namespace
}  // namespace vestibule::sim
