#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/geo/site.hpp"

namespace vestibule::sim {

/// Everything below is in the map frame (ENU at the datum), metres and radians. What is drawn here
/// stands at the height of the lidar and stops both beams and the robot.

/// A wall, fence or hedge without thickness. `id` may be empty; where given it is unique.
struct Wall {
  std::string id;
  std::vector<Point2> points;
  bool closed = false;  ///< also joins the last point to the first
};

/// A wall panel, trough, bale or vehicle.
struct Box {
  std::string id;
  Point2 centre;
  double size_x_m = 1.0;  ///< along its own x axis
  double size_y_m = 1.0;
  double yaw_rad = 0.0;
};

/// A post, silo or trunk.
struct Circle {
  std::string id;
  Point2 centre;
  double radius_m = 0.1;
};

struct Building {
  geo::Building shape;
  bool roof = true;  ///< hides the sky from a GNSS antenna
};

/// A closed door is a wall between its jambs.
struct Door {
  geo::Door shape;
  bool open = true;
};

/// True walls given as a picture: the edges of its dark cells.
struct OccupancyImage {
  std::string image;  ///< relative paths start at the world file
  double resolution_m = 0.05;
  Pose2 T_map_image;            ///< lower left corner of the picture
  double occupied_below = 0.5;  ///< [0, 1] a pixel darker than this share of white is a wall
};

struct Move {
  std::string id;
  Pose2 by;  ///< translation along the map axes, rotation about the object's own centre
};

/// How the prior map of the site differs from the truth, and how it was surveyed: a mapping robot
/// drove the survey paths with a 360 degree lidar when the furniture still stood otherwise.
struct GivenMap {
  std::string building;   ///< the map covers its outline ...
  double apron_m = 12.0;  ///< ... and this much around the centre of each door
  double resolution_m = 0.05;
  Pose2 T_map_grid;                  ///< the truth; a site file knows it only to survey accuracy
  double range_m = 25.0;             ///< reach of the mapping lidar
  double noise_m = 0.01;             ///< of its ranges, one sigma
  double warp_m = 0.01;              ///< smooth distortion of the map, one sigma per axis
  double pose_spacing_m = 0.5;       ///< between scans along the survey paths
  std::vector<std::string> removed;  ///< ids that came after the survey
  std::vector<Move> moved;           ///< ids that stood elsewhere: truth moved `by` this
  std::vector<Box> boxes;            ///< there during the survey, gone now
  std::vector<Circle> circles;
  std::vector<std::vector<Point2>> survey_paths;
};

/// The true world. YAML keys: see config/worlds/farm.yaml.
struct World {
  std::string name;
  Geodetic datum;
  std::vector<Wall> walls;
  std::vector<Box> boxes;
  std::vector<Circle> circles;
  std::optional<OccupancyImage> occupancy_image;
  std::vector<Building> buildings;
  std::vector<Door> doors;
  std::optional<GivenMap> given_map;
};

void describe(ParamIo& io, World& world);

/// Throws ConfigError with file:line of every problem.
[[nodiscard]] World loadWorld(const std::string& path);

/// Smallest signed distance to a roofed building [m]; negative = under a roof. Large without any.
[[nodiscard]] double distanceToRoofs(const World& world, const Point2& p_map);

}  // namespace vestibule::sim
