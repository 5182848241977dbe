#include "vestibule/sim/world.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
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
        "  - {center: [0, 0], radius_m: 1}\n"
        "given_map:\n"
        "  building: stable\n"
        "  removed: [ghost]\n"
        "  survey_paths: [{points: [[0, 0], [1, 0]]}]\n",
        "farm.yaml");
    FAIL() << "accepted";
  } catch (const ConfigError& e) {
    EXPECT_THAT(e.what(), HasSubstr("farm.yaml:2: datum: must be [lat_deg, lon_deg, height_m]"));
    EXPECT_THAT(e.what(), HasSubstr("farm.yaml:4: walls[0].points: needs at least 2 points"));
    EXPECT_THAT(e.what(), HasSubstr("farm.yaml:6: boxes[0].size"));
    EXPECT_THAT(e.what(), HasSubstr("id a is used twice"));
    EXPECT_THAT(e.what(), HasSubstr("farm.yaml:8: circles[0].center: unknown key"));
    EXPECT_THAT(e.what(), HasSubstr("no object has the id ghost"));
    EXPECT_THAT(e.what(), HasSubstr("no building is named stable"));
  }
}

TEST(World, KnowsItsRoofs) {
  const auto world = parseParams<World>(
      "name: w\ndatum: [36.8, -2.4, 20]\nbuildings:\n"
      "  - {name: a, outline: [[0, 0], [10, 0], [10, 5], [0, 5]]}\n"
      "  - {name: yard, outline: [[20, 0], [30, 0], [30, 5], [20, 5]], roof: false}\n",
      "w.yaml");
  EXPECT_DOUBLE_EQ(distanceToRoofs(world, {5, 1}), -1.0);
  EXPECT_DOUBLE_EQ(distanceToRoofs(world, {25, 1}), 15.0);
}

}  // namespace
}  // namespace vestibule::sim
