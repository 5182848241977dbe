#pragma once

#include <string>
#include <utility>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"

namespace vestibule::geo {

/// Corners in the map frame [m], in order; closed implicitly.
using Polygon = std::vector<Point2>;

[[nodiscard]] bool contains(const Polygon& polygon, const Point2& p);
/// Distance to the outline [m], negative inside.
[[nodiscard]] double signedDistance(const Polygon& polygon, const Point2& p);

struct Building {
  std::string name;
  Polygon outline;
};

/// A door as the segment between its jambs, in the map frame.
struct Door {
  std::string name;
  Point2 a;
  Point2 b;
  [[nodiscard]] Point2 centre() const { return {0.5 * (a.x + b.x), 0.5 * (a.y + b.y)}; }
};
[[nodiscard]] double distanceToSegment(const Point2& p, const Point2& a, const Point2& b);

/// A prebuilt indoor map and its georeference.
struct IndoorMap {
  std::string name;
  std::string yaml_path;           ///< map_server YAML; relative paths start at the site file
  Pose2 T_map_grid;                ///< pose of the image's own map frame in the site's map frame
  double sigma_position_m = 0.05;  ///< of T_map_grid
  double sigma_yaw_rad = 0.002;
};

/// What is known of a place before driving there. Validated on loading.
struct Site {
  std::string name;
  Geodetic datum;
  Polygon outdoor_area;  ///< where GNSS waypoints may lie; empty = anywhere within 5 km
  std::vector<IndoorMap> indoor_maps;
  std::vector<Building> buildings;
  std::vector<Door> doors;
  std::string file;  ///< where it was loaded from
};

/// Keys: name, datum: [lat_deg, lon_deg, height_m], outdoor_area: [[x, y], ...],
/// indoor_maps: [{name, map, T_map_grid: [x_m, y_m, yaw_deg], sigma_position_m, sigma_yaw_deg}],
/// buildings: [{name, outline: [[x, y], ...]}], doors: [{name, from: [x, y], to: [x, y]}].
void describe(ParamIo& io, Site& site);

/// Throws ConfigError with file:line of every problem.
[[nodiscard]] Site loadSite(const std::string& path);

/// The smallest signed distance to any building [m]; negative = under a roof. Large without any.
[[nodiscard]] double distanceToBuildings(const Site& site, const Point2& p_map);

}  // namespace vestibule::geo
