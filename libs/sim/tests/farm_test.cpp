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
  ASSERT_EQ(site.doors.size(), 3U);
  ASSERT_EQ(world.doors.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(site.doors[i].name, world.doors[i].shape.name);
    EXPECT_EQ(site.doors[i].a, world.doors[i].shape.a);
    EXPECT_EQ(site.doors[i].b, world.doors[i].shape.b);
    EXPECT_NEAR(
        std::hypot(site.doors[i].a.x - site.doors[i].b.x, site.doors[i].a.y - site.doors[i].b.y),
        3.0,
        1e-9);
  }
  // The survey knows where the maps lie to a few centimetres, but not exactly.
  ASSERT_EQ(site.indoor_maps.size(), 2U);
  for (const geo::IndoorMap& map : site.indoor_maps) {
    SCOPED_TRACE(map.name);
    const GivenMap& given = givenMapOf(world, map.name);
    const Pose2 error = between(given.T_map_grid, map.T_map_grid);
    const Pose2 middle = map.name == "stable" ? Pose2{15.0, 7.0, 0.0} : Pose2{64.0, 1.0, 0.0};
    const Pose2 T_grid_middle = between(given.T_map_grid, middle);
    const Point2 p = transform(error, {T_grid_middle.x, T_grid_middle.y});
    const double off_m = std::hypot(p.x - T_grid_middle.x, p.y - T_grid_middle.y);
    EXPECT_GT(off_m, 0.015);
    EXPECT_LT(off_m, 0.055);
    EXPECT_LT(std::abs(radToDeg(error.phi)), 0.06);
  }
}

TEST(Farm, TheShippedMapIsTheSurveyOfTheWorld) {
  const World world = farm();
  const grid::OccupancyMap map = surveyMap(world, givenMapOf(world, "stable"));
  const cv::Mat made = mapPicture(map);
  const cv::Mat shipped = cv::imread(kRoot + "/maps/farm/stable.pgm", cv::IMREAD_GRAYSCALE);
  ASSERT_EQ(shipped.size(), made.size()) << "make it anew with survey_map";
  const cv::Mat differ = shipped != made;
  // The last bit of sin and cos may differ between C libraries and move a beam to the next cell.
  EXPECT_LE(cv::countNonZero(differ), 50) << "make it anew with survey_map";

  const YAML::Node yaml = YAML::LoadFile(kRoot + "/maps/farm/stable.yaml");
  const Pose2 origin = mapOrigin(map, givenMapOf(world, "stable").T_map_grid);
  EXPECT_EQ(yaml["image"].as<std::string>(), "stable.pgm");
  EXPECT_NEAR(yaml["resolution"].as<double>(), map.resolution(), 1e-6);
  EXPECT_NEAR(yaml["origin"][0].as<double>(), origin.x, 1e-3);
  EXPECT_NEAR(yaml["origin"][1].as<double>(), origin.y, 1e-3);
  EXPECT_NEAR(yaml["origin"][2].as<double>(), 0.0, 1e-9);
}

TEST(Worlds, EveryShippedMapIsTheSurveyOfItsWorld) {
  for (const std::string name :
       {"campus", "farm", "obstacle_course", "office", "small_town", "warehouse_yard"}) {
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

/// A room of 10 x 6 m with a door in the west that is open now.
std::string roomYaml(const std::string& differences) {
  return "name: w\ndatum: [36.8, -2.4, 20]\n"
         "walls:\n  - {points: [[0, 2], [0, 0], [10, 0], [10, 6], [0, 6], [0, 4]]}\n"
         "buildings:\n  - {name: room, outline: [[0, 0], [10, 0], [10, 6], [0, 6]]}\n"
         "doors:\n  - {name: west, from: [0, 2], to: [0, 4]}\n"
         "given_maps:\n  - {name: room, building: room, apron_m: 4, noise_m: 0, " +
         differences + ", survey_paths: [{points: [[1, 3], [9, 3]]}]}\n";
}

TEST(GivenMap, ADoorThatWasShutHidesWhatIsBehindIt) {
  const auto open = parseParams<World>(roomYaml("warp_m: 0"), "w.yaml");
  const auto shut = parseParams<World>(roomYaml("warp_m: 0, doors_changed: [west]"), "w.yaml");
  const grid::OccupancyMap with_way = surveyMap(open, open.given_maps[0]);
  const grid::OccupancyMap without_way = surveyMap(shut, shut.given_maps[0]);
  EXPECT_EQ(with_way.at({-1.5, 3.0}), grid::Cell::kFree);
  EXPECT_EQ(without_way.at({-1.5, 3.0}), grid::Cell::kUnknown);
  EXPECT_EQ(without_way.at({5.0, 3.0}), grid::Cell::kFree);
}

TEST(GivenMap, IsWarpedByCentimetres) {
  // Where the east wall is mapped, every 0.2 m.
  const auto wall = [](const std::string& warp) {
    const auto world = parseParams<World>(roomYaml("resolution_m: 0.01, " + warp), "w.yaml");
    const grid::OccupancyMap map = surveyMap(world, world.given_maps[0]);
    std::vector<double> offsets_m;
    for (double y = 0.5; y < 5.6; y += 0.2) {
      for (double x = 9.8; x < 10.2; x += 0.005) {
        if (map.at({x, y}) != grid::Cell::kOccupied) continue;
        offsets_m.push_back(x - 10.0);
        break;
      }
    }
    return offsets_m;
  };
  const std::vector<double> straight = wall("warp_m: 0");
  const std::vector<double> warped = wall("warp_m: 0.015");
  ASSERT_GT(straight.size(), 15U);
  ASSERT_GT(warped.size(), 15U);
  for (const double offset_m : straight) EXPECT_NEAR(offset_m, 0.0, 0.0101);
  const auto [least, most] = std::minmax_element(warped.begin(), warped.end());
  EXPECT_GT(std::max(-*least, *most), 0.01);
  EXPECT_LT(std::max(-*least, *most), 0.06) << "four sigma";
}

TEST(Farm, TheMapHasItsWallsInPlaceAndItsFurnitureMoved) {
  const World world = farm();
  const grid::OccupancyMap map = surveyMap(world, givenMapOf(world, "stable"));
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
  const GivenMap& given = givenMapOf(world, "stable");
  const WorldGeometry geometry(worldAtSurvey(world, given));
  for (const auto& path : given.survey_paths) {
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
std::vector<Point2> waypointsOf(const std::string& name, const Geodetic& datum) {
  const YAML::Node mission = YAML::LoadFile(kRoot + "/config/missions/" + name + ".yaml");
  const geo::TangentPlane plane(datum);
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

TEST(Worlds, TheMissionsHaveFreeStraightLegsAndEndAtHome) {
  struct Shipped {
    const char* mission;
    const char* world;
    double clearance_m;
  };
  for (const Shipped& shipped :
       {Shipped{"farm_feeding", "farm", 0.9},
        Shipped{"farm_feeding_single_point", "farm", 0.9},
        Shipped{"farm_both_stables", "farm", 0.9},
        Shipped{"campus_delivery", "campus", 0.9},
        Shipped{"warehouse_docks", "warehouse_yard", 0.9},
        Shipped{"town_errand", "small_town", 0.9},
        Shipped{"office_mail", "office", 0.45},
        Shipped{"obstacle_course", "obstacle_course", 0.9}}) {
    const World world = loadWorld(kRoot + "/config/worlds/" + shipped.world + ".yaml");
    const WorldGeometry geometry(world);
    const std::vector<Point2> points = waypointsOf(shipped.mission, world.datum);
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
      EXPECT_GE(clearance_m, shipped.clearance_m)
          << shipped.mission << ", leg " << i << " to (" << points[i + 1].x << ", "
          << points[i + 1].y << ")";
    }
    EXPECT_LT(std::hypot(points.back().x - points[0].x, points.back().y - points[0].y), 0.3)
        << shipped.mission;
  }
  EXPECT_EQ(
      waypointsOf("farm_feeding", farm().datum),
      waypointsOf("farm_feeding_single_point", farm().datum));
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
