#include "vestibule/geo/site.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "vestibule/core/angles.hpp"

namespace vestibule::geo {
namespace {

void polygonField(ParamIo& io, const char* key, Polygon& polygon) {
  std::vector<std::vector<double>> rows;
  for (const Point2& p : polygon) rows.push_back({p.x, p.y});
  io.optional(key, rows, 2);
  polygon.clear();
  for (const auto& row : rows) polygon.push_back({row[0], row[1]});
  if (!polygon.empty() && polygon.size() < 3) {
    io.problem(key, "needs at least 3 corners, has " + std::to_string(polygon.size()));
  }
}

void pointField(ParamIo& io, const char* key, Point2& point) {
  std::vector<double> xy{point.x, point.y};
  io.required(key, xy, 2, 2);
  point = {xy[0], xy[1]};
}

}  // namespace

bool contains(const Polygon& polygon, const Point2& p) {
  bool in = false;
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Point2& a = polygon[i];
    const Point2& b = polygon[j];
    if ((a.y > p.y) != (b.y > p.y) && p.x < (b.x - a.x) * (p.y - a.y) / (b.y - a.y) + a.x) {
      in = !in;
    }
  }
  return in;
}

double distanceToSegment(const Point2& p, const Point2& a, const Point2& b) {
  const double dx = b.x - a.x;
  const double dy = b.y - a.y;
  const double length2 = dx * dx + dy * dy;
  const double s =
      length2 > 0.0 ? std::clamp(((p.x - a.x) * dx + (p.y - a.y) * dy) / length2, 0.0, 1.0) : 0.0;
  return std::hypot(p.x - a.x - s * dx, p.y - a.y - s * dy);
}

double signedDistance(const Polygon& polygon, const Point2& p) {
  double nearest = std::numeric_limits<double>::max();
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    nearest = std::min(nearest, distanceToSegment(p, polygon[j], polygon[i]));
  }
  return contains(polygon, p) ? -nearest : nearest;
}

void describe(ParamIo& io, Building& building) {
  io.required("name", building.name);
  polygonField(io, "outline", building.outline);
  if (building.outline.empty()) io.problem("outline", "missing (required)");
}

void describe(ParamIo& io, Door& door) {
  io.required("name", door.name);
  pointField(io, "from", door.a);
  pointField(io, "to", door.b);
}

void describe(ParamIo& io, IndoorMap& map) {
  io.required("name", map.name);
  io.required("map", map.yaml_path);
  io.required("T_map_grid", map.T_map_grid);
  io.optional("sigma_position_m", map.sigma_position_m, nonNegative());
  io.optionalDegrees("sigma_yaw_deg", map.sigma_yaw_rad, nonNegative());
}

void describe(ParamIo& io, Site& site) {
  io.required("name", site.name);
  std::vector<double> datum{site.datum.lat_deg, site.datum.lon_deg, site.datum.height_m};
  io.required("datum", datum, 3, 3);
  site.datum = {datum[0], datum[1], datum[2]};
  if (std::abs(site.datum.lat_deg) > 90.0 || std::abs(site.datum.lon_deg) > 180.0) {
    io.problem("datum", "must be [lat_deg, lon_deg, height_m] with |lat| <= 90 and |lon| <= 180");
  }
  polygonField(io, "outdoor_area", site.outdoor_area);
  io.list("indoor_maps", site.indoor_maps);
  for (auto map = site.indoor_maps.begin(); map != site.indoor_maps.end(); ++map) {
    const bool again = std::any_of(site.indoor_maps.begin(), map, [&](const IndoorMap& other) {
      return other.name == map->name;
    });
    if (again) io.problem("indoor_maps", "two maps have the name '" + map->name + "'");
  }
  io.list("buildings", site.buildings);
  io.list("doors", site.doors);
}

Site loadSite(const std::string& path) {
  Site site = loadParams<Site>(path);
  site.file = path;
  const auto folder = std::filesystem::path(path).parent_path();
  for (IndoorMap& map : site.indoor_maps) {
    if (std::filesystem::path(map.yaml_path).is_relative()) {
      map.yaml_path = (folder / map.yaml_path).lexically_normal().string();
    }
  }
  return site;
}

double distanceToBuildings(const Site& site, const Point2& p_map) {
  double nearest = std::numeric_limits<double>::max();
  for (const Building& building : site.buildings) {
    nearest = std::min(nearest, signedDistance(building.outline, p_map));
  }
  return nearest;
}

}  // namespace vestibule::geo
