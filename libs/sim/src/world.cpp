#include "vestibule/sim/world.hpp"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <set>

#include "vestibule/core/angles.hpp"

namespace vestibule::sim {
namespace {

void pointField(ParamIo& io, const char* key, Point2& point) {
  std::vector<double> xy{point.x, point.y};
  io.required(key, xy, 2, 2);
  point = {xy[0], xy[1]};
}

void poseField(ParamIo& io, const char* key, Pose2& pose) {
  std::vector<double> values{pose.x, pose.y, radToDeg(pose.phi)};
  io.optional(key, values, 3, 3);
  pose = {values[0], values[1], wrapToPi(degToRad(values[2]))};
}

std::vector<std::vector<double>> rowsOf(const std::vector<Point2>& points) {
  std::vector<std::vector<double>> rows;
  for (const Point2& p : points) rows.push_back({p.x, p.y});
  return rows;
}

void pointsField(ParamIo& io, const char* key, std::vector<Point2>& points, std::size_t min_count) {
  auto rows = rowsOf(points);
  io.optional(key, rows, 2);
  points.clear();
  for (const auto& row : rows) points.push_back({row[0], row[1]});
  if (!io.writing() && points.size() < min_count) {
    io.problem(
        key,
        "needs at least " + std::to_string(min_count) + " points, has " +
            std::to_string(points.size()));
  }
}

struct SurveyPath {
  std::vector<Point2> points;
};

void describe(ParamIo& io, SurveyPath& path) { pointsField(io, "points", path.points, 2); }

}  // namespace

void describe(ParamIo& io, Wall& wall) {
  io.optional("id", wall.id);
  pointsField(io, "points", wall.points, 2);
  io.optional("closed", wall.closed);
}

void describe(ParamIo& io, Box& box) {
  io.optional("id", box.id);
  pointField(io, "centre", box.centre);
  std::vector<double> size{box.size_x_m, box.size_y_m};
  io.required("size", size, 2, 2, positive());
  box.size_x_m = size[0];
  box.size_y_m = size[1];
  io.optionalDegrees("yaw_deg", box.yaw_rad);
}

void describe(ParamIo& io, Circle& circle) {
  io.optional("id", circle.id);
  pointField(io, "centre", circle.centre);
  io.required("radius_m", circle.radius_m, positive());
}

void describe(ParamIo& io, Building& building) {
  io.required("name", building.shape.name);
  pointsField(io, "outline", building.shape.outline, 3);
  io.optional("roof", building.roof);
}

void describe(ParamIo& io, Door& door) {
  io.required("name", door.shape.name);
  pointField(io, "from", door.shape.a);
  pointField(io, "to", door.shape.b);
  io.optional("open", door.open);
}

void describe(ParamIo& io, OccupancyImage& image) {
  io.required("image", image.image);
  io.required("resolution_m", image.resolution_m, positive());
  poseField(io, "origin", image.T_map_image);
  io.optional("occupied_below", image.occupied_below, inside(0.0, 1.0));
}

void describe(ParamIo& io, Move& move) {
  io.required("id", move.id);
  poseField(io, "by", move.by);
}

void describe(ParamIo& io, GivenMap& map) {
  io.required("building", map.building);
  io.optional("apron_m", map.apron_m, nonNegative());
  io.optional("resolution_m", map.resolution_m, within(0.01, 1.0));
  poseField(io, "T_map_grid", map.T_map_grid);
  io.optional("range_m", map.range_m, positive());
  io.optional("noise_m", map.noise_m, nonNegative());
  io.optional("warp_m", map.warp_m, nonNegative());
  io.optional("pose_spacing_m", map.pose_spacing_m, within(0.05, 10.0));
  io.optional("removed", map.removed);
  io.list("moved", map.moved);
  io.list("boxes", map.boxes);
  io.list("circles", map.circles);
  std::vector<SurveyPath> paths;
  for (const auto& points : map.survey_paths) paths.push_back({points});
  io.list("survey_paths", paths, true);
  map.survey_paths.clear();
  for (const SurveyPath& path : paths) map.survey_paths.push_back(path.points);
}

void describe(ParamIo& io, World& world) {
  io.required("name", world.name);
  std::vector<double> datum{world.datum.lat_deg, world.datum.lon_deg, world.datum.height_m};
  io.required("datum", datum, 3, 3);
  world.datum = {datum[0], datum[1], datum[2]};
  if (std::abs(world.datum.lat_deg) > 90.0 || std::abs(world.datum.lon_deg) > 180.0) {
    io.problem("datum", "must be [lat_deg, lon_deg, height_m] with |lat| <= 90 and |lon| <= 180");
  }
  io.list("walls", world.walls);
  io.list("boxes", world.boxes);
  io.list("circles", world.circles);
  io.section("occupancy_image", world.occupancy_image);
  io.list("buildings", world.buildings);
  io.list("doors", world.doors);
  io.section("given_map", world.given_map);

  std::set<std::string> ids;
  const auto claim = [&](const char* key, const std::string& id) {
    if (!id.empty() && !ids.insert(id).second) io.problem(key, "id " + id + " is used twice");
  };
  for (const Wall& wall : world.walls) claim("walls", wall.id);
  for (const Box& box : world.boxes) claim("boxes", box.id);
  for (const Circle& circle : world.circles) claim("circles", circle.id);
  if (!world.given_map) return;
  const auto known = [&](const std::string& what, const std::string& id) {
    if (ids.count(id) == 0) io.problem("given_map", what + ": no object has the id " + id);
  };
  for (const std::string& id : world.given_map->removed) known("removed", id);
  for (const Move& move : world.given_map->moved) known("moved", move.id);
  const bool has_building =
      std::any_of(world.buildings.begin(), world.buildings.end(), [&](const Building& building) {
        return building.shape.name == world.given_map->building;
      });
  if (!has_building) {
    io.problem("given_map", "building: no building is named " + world.given_map->building);
  }
}

World loadWorld(const std::string& path) {
  World world = loadParams<World>(path);
  if (world.occupancy_image) {
    std::string& image = world.occupancy_image->image;
    if (std::filesystem::path(image).is_relative()) {
      image = (std::filesystem::path(path).parent_path() / image).lexically_normal().string();
    }
  }
  return world;
}

double distanceToRoofs(const World& world, const Point2& p_map) {
  double nearest = std::numeric_limits<double>::max();
  for (const Building& building : world.buildings) {
    if (!building.roof) continue;
    nearest = std::min(nearest, geo::signedDistance(building.shape.outline, p_map));
  }
  return nearest;
}

}  // namespace vestibule::sim
