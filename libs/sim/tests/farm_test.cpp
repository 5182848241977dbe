// What the project ships for the farm: world, site, prior map, missions, robot configurations.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "map_picture.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/sim/given_map.hpp"
#include "vestibule/sim/simulator.hpp"

namespace vestibule::sim {
namespace {

const std::string kRoot = VESTIBULE_SOURCE_DIR;

World farm() { return loadWorld(kRoot + "/config/worlds/farm.yaml"); }

TEST(Farm, TheSiteDescribesTheWorld) {
  const World world = farm();
  const geo::Site site = geo::loadSite(kRoot + "/config/sites/farm.yaml");
  EXPECT_EQ(site.datum.lat_deg, world.datum.lat_deg);
  EXPECT_EQ(site.datum.lon_deg, world.datum.lon_deg);
  ASSERT_EQ(site.buildings.size(), world.buildings.size());
  for (std::size_t i = 0; i < site.buildings.size(); ++i) {
    EXPECT_EQ(site.buildings[i].name, world.buildings[i].shape.name);
    EXPECT_EQ(site.buildings[i].outline, world.buildings[i].shape.outline);
  }
  ASSERT_EQ(site.doors.size(), 2U);
  ASSERT_EQ(world.doors.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(site.doors[i].name, world.doors[i].shape.name);
    EXPECT_EQ(site.doors[i].a, world.doors[i].shape.a);
    EXPECT_EQ(site.doors[i].b, world.doors[i].shape.b);
    EXPECT_NEAR(
        std::hypot(site.doors[i].a.x - site.doors[i].b.x, site.doors[i].a.y - site.doors[i].b.y),
        3.0,
        1e-9);
  }
  // The survey knows where the map lies to a few centimetres, but not exactly.
  ASSERT_EQ(site.indoor_maps.size(), 1U);
  const Pose2 error = between(givenMapOf(world).T_map_grid, site.indoor_maps[0].T_map_grid);
  const Pose2 T_grid_stable = between(givenMapOf(world).T_map_grid, Pose2{15.0, 7.0, 0.0});
  const Point2 p = transform(error, {T_grid_stable.x, T_grid_stable.y});
  const double off_m = std::hypot(p.x - T_grid_stable.x, p.y - T_grid_stable.y);
  EXPECT_GT(off_m, 0.015);
  EXPECT_LT(off_m, 0.035);
  EXPECT_NEAR(radToDeg(error.phi), 0.05, 1e-6);
}

TEST(Farm, TheShippedMapIsTheSurveyOfTheWorld) {
  const World world = farm();
  const grid::OccupancyMap map = surveyMap(world, givenMapOf(world));
  const cv::Mat made = mapPicture(map);
  const cv::Mat shipped = cv::imread(kRoot + "/maps/farm/stable.pgm", cv::IMREAD_GRAYSCALE);
  ASSERT_EQ(shipped.size(), made.size()) << "make it anew with survey_map";
  const cv::Mat differ = shipped != made;
  // The last bit of sin and cos may differ between C libraries and move a beam to the next cell.
  EXPECT_LE(cv::countNonZero(differ), 50) << "make it anew with survey_map";

  const YAML::Node yaml = YAML::LoadFile(kRoot + "/maps/farm/stable.yaml");
  const Pose2 origin = mapOrigin(map, givenMapOf(world).T_map_grid);
  EXPECT_EQ(yaml["image"].as<std::string>(), "stable.pgm");
  EXPECT_NEAR(yaml["resolution"].as<double>(), map.resolution(), 1e-6);
  EXPECT_NEAR(yaml["origin"][0].as<double>(), origin.x, 1e-3);
  EXPECT_NEAR(yaml["origin"][1].as<double>(), origin.y, 1e-3);
  EXPECT_NEAR(yaml["origin"][2].as<double>(), 0.0, 1e-9);
}

TEST(Worlds, EveryShippedMapIsTheSurveyOfItsWorld) {
  for (const std::string name : {"campus", "office", "small_town", "warehouse_yard"}) {
    const World world = loadWorld(kRoot + "/config/worlds/" + name + ".yaml");
    for (const GivenMap& given : world.given_maps) {
      SCOPED_TRACE(name + " " + given.name);
      const cv::Mat made = mapPicture(surveyMap(world, given));
      const cv::Mat shipped =
          cv::imread(kRoot + "/maps/" + name + "/" + given.name + ".pgm", cv::IMREAD_GRAYSCALE);
      ASSERT_EQ(shipped.size(), made.size()) << "make it anew with survey_map";
      const cv::Mat differ = shipped != made;
      EXPECT_LE(cv::countNonZero(differ), 50) << "make it anew with survey_map";
      const WorldGeometry then(worldAtSurvey(world, given));
      for (const auto& path : given.survey_paths) {
        for (std::size_t i = 0; i + 1 < path.size(); ++i) {
          for (double s = 0.0; s <= 1.0; s += 0.02) {
            const Point2 p{
                path[i].x + s * (path[i + 1].x - path[i].x),
                path[i].y + s * (path[i + 1].y - path[i].y)};
            EXPECT_GT(then.clearance(p), 0.3) << "(" << p.x << ", " << p.y << ")";
          }
        }
      }
    }
  }
}

TEST(Farm, TheMapHasItsWallsInPlaceAndItsFurnitureMoved) {
  const World world = farm();
  const grid::OccupancyMap map = surveyMap(world, givenMapOf(world));
  const auto occupied_near = [&](const Point2& p) {
    for (double dx = -0.05; dx <= 0.051; dx += 0.05) {
      for (double dy = -0.05; dy <= 0.051; dy += 0.05) {
        if (map.at({p.x + dx, p.y + dy}) == grid::Cell::kOccupied) return true;
      }
    }
    return false;
  };
  // Both faces of the outer walls beside the west door, the east wall, a bollard.
  EXPECT_TRUE(occupied_near({0.2, 4.0}));
  EXPECT_TRUE(occupied_near({0.0, 4.0}));
  EXPECT_TRUE(occupied_near({29.8, 7.5}));
  EXPECT_TRUE(occupied_near({-2.72, 4.8}));
  // The pallet in the lane came later; the barrow is gone.
  EXPECT_EQ(map.at({13.2, 8.35}), grid::Cell::kFree);
  EXPECT_TRUE(occupied_near({24.55, 7.8}));
  EXPECT_GT(WorldGeometry(world).clearance({24.55, 7.8}), 0.5);
  // Free in the lane and on the aprons, unknown in the yard.
  EXPECT_EQ(map.at({9.0, 7.0}), grid::Cell::kFree);
  EXPECT_EQ(map.at({-8.0, 7.0}), grid::Cell::kFree);
  EXPECT_EQ(map.at({25.5, -9.0}), grid::Cell::kFree);
  EXPECT_EQ(map.at({-20.0, 0.0}), grid::Cell::kUnknown);
  EXPECT_EQ(map.at({28.6, 2.0}), grid::Cell::kUnknown);
}

TEST(Farm, TheMappingRobotDroveThroughNothing) {
  const World world = farm();
  const WorldGeometry geometry(worldAtSurvey(world, givenMapOf(world)));
  for (const auto& path : givenMapOf(world).survey_paths) {
    for (std::size_t i = 0; i + 1 < path.size(); ++i) {
      for (double s = 0.0; s <= 1.0; s += 0.01) {
        const Point2 p{
            path[i].x + s * (path[i + 1].x - path[i].x),
            path[i].y + s * (path[i + 1].y - path[i].y)};
        EXPECT_GT(geometry.clearance(p), 0.6) << "(" << p.x << ", " << p.y << ")";
      }
    }
  }
}

/// Start and waypoints of a mission file in map metres, in order.
std::vector<Point2> waypointsOf(const std::string& name) {
  const YAML::Node mission = YAML::LoadFile(kRoot + "/config/missions/" + name);
  const geo::TangentPlane plane(farm().datum);
  std::vector<Point2> points{
      {mission["start"]["x"].as<double>(), mission["start"]["y"].as<double>()}};
  for (const YAML::Node& path : mission["paths"]) {
    for (const auto& entry : path["waypoints"]) {
      const YAML::Node& waypoint = entry.second;
      if (waypoint.IsMap()) {
        points.push_back({waypoint["x"].as<double>(), waypoint["y"].as<double>()});
      } else {
        const Eigen::Vector3d enu = plane.toEnu(
            {waypoint[0].as<double>(), waypoint[1].as<double>(), waypoint[2].as<double>()});
        points.push_back({enu.x(), enu.y()});
      }
    }
  }
  return points;
}

TEST(Farm, TheMissionsHaveFreeStraightLegs) {
  const WorldGeometry geometry(farm());
  for (const std::string name : {"farm_feeding.yaml", "farm_feeding_single_point.yaml"}) {
    const std::vector<Point2> points = waypointsOf(name);
    ASSERT_GE(points.size(), 14U);
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
      const double length_m =
          std::hypot(points[i + 1].x - points[i].x, points[i + 1].y - points[i].y);
      double clearance_m = 1e9;
      for (double s = 0.0; s <= 1.0; s += 0.02 / length_m) {
        clearance_m = std::min(
            clearance_m,
            geometry.clearance(
                {points[i].x + s * (points[i + 1].x - points[i].x),
                 points[i].y + s * (points[i + 1].y - points[i].y)}));
      }
      EXPECT_GE(clearance_m, 0.9) << name << ", leg " << i << " to (" << points[i + 1].x << ", "
                                  << points[i + 1].y << ")";
    }
    // In by one door, out by the other, home again.
    EXPECT_LT(std::hypot(points.back().x - points[0].x, points.back().y - points[0].y), 0.01);
  }
  EXPECT_EQ(waypointsOf("farm_feeding.yaml"), waypointsOf("farm_feeding_single_point.yaml"));
}

TEST(Farm, TheRobotConfigurationsSayWhatTheyMean) {
  const auto rtk = loadParams<SimParams>(kRoot + "/config/sim/rtk.yaml");
  EXPECT_EQ(dumpParams(rtk), dumpParams(SimParams{})) << "rtk.yaml lists the defaults";
  auto single = loadParams<SimParams>(kRoot + "/config/sim/single_point.yaml");
  EXPECT_EQ(single.gnss.receiver, GnssClass::kSingle);
  single.gnss.receiver = GnssClass::kRtk;
  EXPECT_EQ(dumpParams(single), dumpParams(rtk));
}

}  // namespace
}  // namespace vestibule::sim
