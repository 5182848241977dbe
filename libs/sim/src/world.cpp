#include "vestibule/sim/world.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <set>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::sim {
namespace {

void pointField(ParamIo& io, const char* key, Point2& point) {
  std::vector<double> xy{point.x, point.y};
  io.required(key, xy, 2, 2);
  point = {xy[0], xy[1]};
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

void materialField(ParamIo& io, Material& material) {
  io.optional(
      "material",
      material,
      {{"solid", Material::kSolid},
       {"dark", Material::kDark},
       {"glass", Material::kGlass},
       {"foliage", Material::kFoliage}});
}

/// Height, lower edge and material of a solid.
template <class Solid>
void solidFields(ParamIo& io, Solid& solid) {
  io.optional("height_m", solid.height_m, positive());
  io.optional("base_m", solid.base_m, nonNegative());
  materialField(io, solid.material);
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
  solidFields(io, wall);
}

void describe(ParamIo& io, Box& box) {
  io.optional("id", box.id);
  pointField(io, "centre", box.centre);
  std::vector<double> size{box.size_x_m, box.size_y_m};
  io.required("size", size, 2, 2, positive());
  box.size_x_m = size[0];
  box.size_y_m = size[1];
  io.optionalDegrees("yaw_deg", box.yaw_rad);
  solidFields(io, box);
}

void describe(ParamIo& io, Circle& circle) {
  io.optional("id", circle.id);
  pointField(io, "centre", circle.centre);
  io.required("radius_m", circle.radius_m, positive());
  solidFields(io, circle);
}

void describe(ParamIo& io, Building& building) {
  io.required("name", building.shape.name);
  pointsField(io, "outline", building.shape.outline, 3);
  io.optional("roof", building.roof);
  io.optional("roof_height_m", building.roof_height_m, positive());
  building.source = io.here();
}

void describe(ParamIo& io, DoorChange& change) {
  io.required("at_s", change.at_s, nonNegative());
  io.optional("open", change.open);
  io.optional("over_s", change.over_s, positive());
}

void describe(ParamIo& io, Door& door) {
  io.required("name", door.shape.name);
  pointField(io, "from", door.shape.a);
  pointField(io, "to", door.shape.b);
  if (std::hypot(door.shape.b.x - door.shape.a.x, door.shape.b.y - door.shape.a.y) < 1e-3) {
    io.problem("to", "must not be where `from` is");
  }
  io.optional("open", door.open);
  io.optional("height_m", door.height_m, positive());
  io.list("changes", door.changes);
  for (std::size_t i = 1; i < door.changes.size(); ++i) {
    const DoorChange& before = door.changes[i - 1];
    if (door.changes[i].at_s < before.at_s + before.over_s) {
      io.problem("changes", "must be in the order of time, each after the end of the one before");
    }
  }
  door.source = io.here();
}

void describe(ParamIo& io, Mover& mover) {
  io.optional("id", mover.id);
  io.optional("person", mover.person);
  if (!mover.person && !io.writing() && !io.has("height_m")) mover.height_m = 2.5;
  io.optional("radius_m", mover.radius_m, positive());
  io.optional("length_m", mover.length_m, positive());
  io.optional("width_m", mover.width_m, positive());
  io.optional("height_m", mover.height_m, positive());
  pointsField(io, "path", mover.path, 2);
  const auto elsewhere = [&](const Point2& p) {
    return std::hypot(p.x - mover.path.front().x, p.y - mover.path.front().y) > 1e-3;
  };
  if (mover.path.size() > 1 && std::none_of(mover.path.begin(), mover.path.end(), elsewhere)) {
    io.problem("path", "must lead somewhere; what stands still is a box or a circle");
  }
  io.optional("speed_mps", mover.speed_mps, positive());
  io.optional("start_s", mover.start_s, nonNegative());
  io.optional("pause_s", mover.pause_s, nonNegative());
  io.optional("round", mover.round);
}

void describe(ParamIo& io, GroundClass& ground) {
  io.optional("name", ground.name);
  io.optional("icr_scale", ground.icr_scale, within(0.2, 5.0));
  io.optional("grip_scale", ground.grip_scale, within(0.1, 2.0));
  io.optional("slip_scale", ground.slip_scale, within(0.0, 20.0));
  io.optional("roughness_m", ground.roughness_m, within(0.0, 0.3));
}

void describe(ParamIo& io, GroundArea& area) {
  pointsField(io, "outline", area.outline, 3);
  describe(io, area.ground);
}

void describe(ParamIo& io, HeightField& field) {
  io.required("image", field.image);
  io.optional("resolution_m", field.resolution_m, positive());
  io.optional("origin", field.T_map_image);
  io.optional("low_m", field.low_m);
  io.optional("high_m", field.high_m);
  if (!(field.high_m > field.low_m)) io.problem("high_m", "must be above low_m");
  field.source = io.here("image");
}

void describe(ParamIo& io, Ramp& ramp) {
  pointField(io, "from", ramp.from);
  pointField(io, "to", ramp.to);
  io.optional("width_m", ramp.width_m, positive());
  io.optional("start_m", ramp.start_m);
  io.required("rise_m", ramp.rise_m);
  if (std::hypot(ramp.to.x - ramp.from.x, ramp.to.y - ramp.from.y) < 1e-3) {
    io.problem("to", "must not be where `from` is");
  }
}

void describe(ParamIo& io, Plate& plate) {
  pointsField(io, "outline", plate.outline, 3);
  io.required("height_m", plate.height_m);
}

void describe(ParamIo& io, MapServerImport& import) {
  io.required("yaml", import.yaml);
  io.optional("T_map_grid", import.T_map_grid);
  import.source = io.here("yaml");
}

void describe(ParamIo& io, OccupancyImage& image) {
  io.required("image", image.image);
  io.required("resolution_m", image.resolution_m, positive());
  io.optional("origin", image.T_map_image);
  io.optional("occupied_below", image.occupied_below, inside(0.0, 1.0));
  io.optional("negate", image.negate);
  io.optional("height_m", image.height_m, positive());
  image.source = io.here("image");
}

void describe(ParamIo& io, Move& move) {
  io.required("id", move.id);
  io.optional("by", move.by);
}

void describe(ParamIo& io, GivenMap& map) {
  io.required("name", map.name);
  io.required("building", map.building);
  io.optional("apron_m", map.apron_m, nonNegative());
  io.optional("resolution_m", map.resolution_m, within(0.01, 1.0));
  io.optional("T_map_grid", map.T_map_grid);
  io.optional("range_m", map.range_m, positive());
  io.optional("noise_m", map.noise_m, nonNegative());
  io.optional("warp_m", map.warp_m, nonNegative());
  io.optional("pose_spacing_m", map.pose_spacing_m, within(0.05, 10.0));
  io.optional("removed", map.removed);
  io.optional("doors_changed", map.doors_changed);
  map.source = io.here();
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
  io.section("map_server", world.map_server);
  io.optional("sdf", world.sdf);
  world.sdf_source = io.here("sdf");
  io.list("buildings", world.buildings);
  io.list("doors", world.doors);
  io.list("movers", world.movers);
  io.section("ground", world.ground);
  io.list("ground_areas", world.ground_areas);
  std::optional<HeightField> field;
  if (!world.terrain.fields.empty()) field = world.terrain.fields.front();
  io.section("height_field", field);
  world.terrain.fields.clear();
  if (field) world.terrain.fields.push_back(*field);
  io.list("plates", world.terrain.plates);
  io.list("ramps", world.terrain.ramps);
  io.list("given_maps", world.given_maps);

  std::set<std::string> ids;
  const auto claim = [&](const char* key, const std::string& id) {
    if (!id.empty() && !ids.insert(id).second) io.problem(key, "id " + id + " is used twice");
  };
  for (const Wall& wall : world.walls) claim("walls", wall.id);
  for (const Box& box : world.boxes) claim("boxes", box.id);
  for (const Circle& circle : world.circles) claim("circles", circle.id);
  for (const Mover& mover : world.movers) claim("movers", mover.id);
}

namespace {

bool crosses(const Point2& a, const Point2& b, const Point2& c, const Point2& d) {
  const auto side = [](const Point2& p, const Point2& q, const Point2& r) {
    const double area = (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
    constexpr double kTouch_m2 = 1e-6;
    return area > kTouch_m2 ? 1 : (area < -kTouch_m2 ? -1 : 0);
  };
  return side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0;
}

bool crossesItself(const geo::Polygon& outline) {
  const std::size_t n = outline.size();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 2; j < n; ++j) {
      if (i == 0 && j == n - 1) continue;
      if (crosses(outline[i], outline[i + 1], outline[j], outline[(j + 1) % n])) return true;
    }
  }
  return false;
}

bool overlap(const geo::Polygon& a, const geo::Polygon& b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) {
      if (crosses(a[i], a[(i + 1) % a.size()], b[j], b[(j + 1) % b.size()])) return true;
    }
  }
  constexpr double kTouch_m = 1e-3;
  const auto inside = [&](const geo::Polygon& outer, const geo::Polygon& inner) {
    Point2 centre{0.0, 0.0};
    for (const Point2& p : inner) {
      if (geo::signedDistance(outer, p) < -kTouch_m) return true;
      centre = centre + p / static_cast<double>(inner.size());
    }
    return geo::signedDistance(outer, centre) < -kTouch_m &&
           geo::signedDistance(inner, centre) < -kTouch_m;
  };
  return inside(a, b) || inside(b, a);
}

/// What only the whole world can be checked for, one "file:line: ..." per problem.
std::string problemsOf(const World& world, const std::string& path) {
  std::string problems;
  const auto problem = [&](const SourceRef& where, const std::string& text) {
    problems +=
        (problems.empty() ? "" : "\n") + (where.line > 0 ? where.text() : path) + ": " + text;
  };
  for (std::size_t i = 0; i < world.buildings.size(); ++i) {
    const Building& building = world.buildings[i];
    if (crossesItself(building.shape.outline)) {
      problem(building.source, "building " + building.shape.name + ": its outline crosses itself");
    }
    for (std::size_t j = 0; j < i; ++j) {
      const Building& other = world.buildings[j];
      if (building.roof && other.roof && overlap(building.shape.outline, other.shape.outline)) {
        problem(
            building.source,
            "building " + building.shape.name + ": its roof overlaps that of " + other.shape.name +
                "; let outlines touch at most");
      }
    }
  }
  const std::vector<Segment> faces = segmentsOf(world);
  const auto on_a_wall = [&](const Point2& p) {
    constexpr double kNear_m = 0.3;
    for (const Segment& face : faces) {
      if (geo::distanceToSegment(p, face.a, face.b) <= kNear_m) return true;
    }
    for (const Building& building : world.buildings) {
      if (std::abs(geo::signedDistance(building.shape.outline, p)) <= kNear_m) return true;
    }
    return false;
  };
  for (const Door& door : world.doors) {
    if (!on_a_wall(door.shape.a) || !on_a_wall(door.shape.b)) {
      problem(
          door.source,
          "door " + door.shape.name +
              ": is not on a wall: both its ends must lie within 0.3 m of a wall or an outline");
    }
  }
  const auto name_once = [&](const char* what, const auto& things) {
    std::set<std::string> taken;
    for (const auto& thing : things) {
      if (!taken.insert(thing.shape.name).second) {
        problem(thing.source, what + thing.shape.name + ": the name is used twice");
      }
    }
  };
  name_once("building ", world.buildings);
  name_once("door ", world.doors);
  std::set<std::string> ids;
  for (const Wall& wall : world.walls) ids.insert(wall.id);
  for (const Box& box : world.boxes) ids.insert(box.id);
  for (const Circle& circle : world.circles) ids.insert(circle.id);
  std::set<std::string> names;
  for (const GivenMap& given : world.given_maps) {
    const std::string what = "given map " + given.name + ": ";
    if (!names.insert(given.name).second) problem(given.source, what + "the name is used twice");
    const auto known = [&](const char* key, const std::string& id) {
      if (id.empty() || ids.count(id) == 0) {
        problem(given.source, what + key + ": no object has the id " + id);
      }
    };
    for (const std::string& id : given.removed) known("removed", id);
    for (const Move& move : given.moved) known("moved", move.id);
    const auto has = [&](const auto& things, const std::string& name) {
      return std::any_of(things.begin(), things.end(), [&](const auto& thing) {
        return thing.shape.name == name;
      });
    };
    if (!has(world.buildings, given.building)) {
      problem(given.source, what + "building: no building is named " + given.building);
    }
    for (const std::string& door : given.doors_changed) {
      if (!has(world.doors, door)) {
        problem(given.source, what + "doors_changed: no door is named " + door);
      }
    }
  }
  return problems;
}

/// As the map server describes its maps; what the walls do not need is read and left.
struct MapServerYaml {
  std::string image;
  double resolution_m = 0.05;
  std::vector<double> origin{0.0, 0.0, 0.0};
  int negate = 0;
  double occupied_thresh = 0.65;
  double free_thresh = 0.196;
  std::string mode;
};

void describe(ParamIo& io, MapServerYaml& yaml) {
  io.required("image", yaml.image);
  io.required("resolution", yaml.resolution_m, positive());
  io.required("origin", yaml.origin, 3, 3);
  io.optional("negate", yaml.negate, within(0, 1));
  io.optional("occupied_thresh", yaml.occupied_thresh, inside(0.0, 1.0));
  io.optional("free_thresh", yaml.free_thresh, inside(0.0, 1.0));
  io.optional("mode", yaml.mode);
}

OccupancyImage imageOf(const MapServerImport& import) {
  const auto yaml = loadParams<MapServerYaml>(import.yaml);
  OccupancyImage image;
  image.image = yaml.image;
  image.resolution_m = yaml.resolution_m;
  image.T_map_image =
      compose(import.T_map_grid, Pose2{yaml.origin[0], yaml.origin[1], yaml.origin[2]});
  image.occupied_below = 1.0 - yaml.occupied_thresh;
  image.negate = yaml.negate == 1;
  image.source = import.source;
  return image;
}

}  // namespace

World loadWorld(const std::string& path) {
  World world = loadParams<World>(path);
  const auto resolve = [](std::string& file, const std::string& from) {
    if (std::filesystem::path(file).is_relative()) {
      file = (std::filesystem::path(from).parent_path() / file).lexically_normal().string();
    }
  };
  // What is wrong with a file that the world names is said with the line that names it.
  const auto named_at = [](const SourceRef& where, const auto& use) {
    try {
      use();
    } catch (const InputError& e) {
      throw ConfigError(where.text() + ": " + e.what());
    }
  };
  if (world.occupancy_image) resolve(world.occupancy_image->image, path);
  if (world.map_server) {
    MapServerImport& import = *world.map_server;
    resolve(import.yaml, path);
    if (world.occupancy_image) {
      throw ConfigError(import.source.text() + ": map_server: give either this or occupancy_image");
    }
    if (!std::filesystem::is_regular_file(import.yaml)) {
      throw ConfigError(import.source.text() + ": map_server: " + import.yaml + ": no such file");
    }
    world.occupancy_image = imageOf(import);
    resolve(world.occupancy_image->image, import.yaml);
  }
  if (world.occupancy_image) {
    named_at(world.occupancy_image->source, [&] { (void)segmentsOf(world); });
  }
  if (world.sdf) {
    resolve(*world.sdf, path);
    named_at(world.sdf_source, [&] { addSdf(world, *world.sdf); });
  }
  for (HeightField& field : world.terrain.fields) {
    resolve(field.image, path);
    named_at(field.source, [&] { loadHeights(field); });
  }
  const std::string problems = problemsOf(world, path);
  if (!problems.empty()) throw ConfigError(problems);
  return world;
}

const GivenMap& givenMapOf(const World& world, const std::string& name) {
  std::string known;
  for (const GivenMap& given : world.given_maps) {
    if (given.name == name || (name.empty() && world.given_maps.size() == 1)) return given;
    known += " " + given.name;
  }
  throw ConfigError(
      "world " + world.name + ": has no given map '" + name +
      "'; there are:" + (known.empty() ? " none" : known));
}

}  // namespace vestibule::sim
