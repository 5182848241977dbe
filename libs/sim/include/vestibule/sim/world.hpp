#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/sim/ground.hpp"
#include "vestibule/sim/terrain.hpp"
#include "vestibule/sim/world_geometry.hpp"

namespace vestibule::sim {

/// Everything below is in the map frame (ENU at the datum), metres and radians; heights are above
/// the ground where a thing stands. File format: docs/worlds.md.

/// A wall, fence or hedge without thickness. `id` may be empty; where given it is unique.
struct Wall {
  std::string id;
  std::vector<Point2> points;
  bool closed = false;  ///< also joins the last point to the first
  double height_m = 2.5;
  double base_m = 0.0;  ///< of its lower edge
  Material material = Material::kSolid;
};

/// A wall panel, trough, bale or vehicle.
struct Box {
  std::string id;
  Point2 centre;
  double size_x_m = 1.0;  ///< along its own x axis
  double size_y_m = 1.0;
  double yaw_rad = 0.0;
  double height_m = 1.5;
  double base_m = 0.0;
  Material material = Material::kSolid;
};

/// A post, silo or trunk.
struct Circle {
  std::string id;
  Point2 centre;
  double radius_m = 0.1;
  double height_m = 2.5;
  double base_m = 0.0;
  Material material = Material::kSolid;
};

/// A roof over an outline. Its walls are walls of their own: without them it is a covered passage.
struct Building {
  geo::Building shape;
  bool roof = true;  ///< hides the sky from a GNSS antenna
  double roof_height_m = 4.0;
  SourceRef source;
};

/// From `at_s` on the door slides until it is open or closed.
struct DoorChange {
  double at_s = 0.0;
  bool open = true;
  double over_s = 2.0;
};

/// A closed door is a wall between its jambs; a moving one fills the way from its first jamb on.
struct Door {
  geo::Door shape;
  bool open = true;  ///< at the start
  double height_m = 2.2;
  std::vector<DoorChange> changes;  ///< in the order of time
  SourceRef source;
};

/// A person or a vehicle that goes along a path, to its end and back, or round a closed one.
struct Mover {
  std::string id;
  bool person = true;      ///< a cylinder; otherwise a box turned along its way
  double radius_m = 0.25;  ///< of a person
  double length_m = 5.0;   ///< of a vehicle
  double width_m = 2.0;
  double height_m = 1.75;
  std::vector<Point2> path;
  double speed_mps = 1.0;
  double start_s = 0.0;  ///< stands at the beginning until then
  double pause_s = 0.0;  ///< at both ends
  bool round = false;    ///< from the end straight to the beginning
};

struct GroundArea {
  geo::Polygon outline;
  GroundClass ground;
};

/// Walls out of the map of a mapping program.
struct MapServerImport {
  std::string yaml;  ///< relative paths start at the world file
  Pose2 T_map_grid;  ///< pose of that map's own frame
  SourceRef source;
};

/// True walls given as a picture: the edges of its dark cells.
struct OccupancyImage {
  std::string image;  ///< relative paths start at the world file
  double resolution_m = 0.05;
  Pose2 T_map_image;            ///< lower left corner of the picture
  double occupied_below = 0.5;  ///< [0, 1] a pixel darker than this share of white is a wall
  bool negate = false;          ///< light pixels are walls
  double height_m = 2.5;
  SourceRef source;
};

struct Move {
  std::string id;
  Pose2 by;  ///< translation along the map axes, rotation about the object's own centre
};

/// How a prior map of the site differs from the truth, and how it was surveyed: a mapping robot
/// drove the survey paths with a 360 degree lidar when the furniture still stood otherwise and
/// nothing moved.
struct GivenMap {
  std::string name;
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
  std::vector<std::string> doors_changed;  ///< open now, closed then, and the other way round
  SourceRef source;
};

/// The true world.
struct World {
  std::string name;
  Geodetic datum;
  std::vector<Wall> walls;
  std::vector<Box> boxes;
  std::vector<Circle> circles;
  std::optional<OccupancyImage> occupancy_image;
  std::optional<MapServerImport> map_server;
  std::optional<std::string> sdf;  ///< a Gazebo world: its boxes and cylinders
  SourceRef sdf_source;
  std::vector<Mover> movers;
  GroundClass ground;                    ///< where no area says otherwise
  std::vector<GroundArea> ground_areas;  ///< a later one covers an earlier one
  Terrain terrain;
  std::vector<Building> buildings;
  std::vector<Door> doors;
  std::vector<GivenMap> given_maps;
};

void describe(ParamIo& io, World& world);

/// Throws ConfigError with file:line of every problem.
[[nodiscard]] World loadWorld(const std::string& path);

/// Adds the boxes and cylinders of the static models of a Gazebo world. Throws InputError.
void addSdf(World& world, const std::string& path);

/// The given map of that name; of the only one with an empty name. Throws ConfigError.
[[nodiscard]] const GivenMap& givenMapOf(const World& world, const std::string& name = {});

}  // namespace vestibule::sim
