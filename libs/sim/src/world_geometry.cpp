#include "vestibule/sim/world_geometry.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/sim/ground_rays.hpp"
#include "vestibule/sim/world.hpp"

namespace vestibule::sim {
namespace {

constexpr int kCircleCorners = 24;
constexpr double kCell_m = 1.0;         // farm-like density: a handful of lines per used cell
constexpr int kMaxCellsPerSide = 2000;  // a larger world gets larger cells

/// An upright face on the ground: heights of the solid above the ground under its middle.
template <class Solid>
Segment faceOf(const Solid& solid, const Terrain& terrain, const Point2& a, const Point2& b) {
  const double ground_m =
      terrain.flat() ? 0.0 : terrain.height({0.5 * (a.x + b.x), 0.5 * (a.y + b.y)});
  const double low_m = ground_m + solid.base_m;
  return {a, b, low_m, low_m + solid.height_m, solid.material};
}

template <class Solid>
void addLoop(
    std::vector<Segment>& segments,
    const Solid& solid,
    const Terrain& terrain,
    const std::vector<Point2>& corners) {
  for (std::size_t i = 0; i < corners.size(); ++i) {
    segments.push_back(faceOf(solid, terrain, corners[i], corners[(i + 1) % corners.size()]));
  }
}

std::vector<Point2> circleCorners(const Point2& centre, double circle_m, int count) {
  // Corners outside, edge middles inside: the mean radius is the circle's.
  const double step = 2.0 * kPi / count;
  const double radius_m = circle_m * 2.0 / (1.0 + std::cos(0.5 * step));
  std::vector<Point2> corners;
  for (int i = 0; i < count; ++i) {
    corners.push_back(
        {centre.x + radius_m * std::cos(i * step), centre.y + radius_m * std::sin(i * step)});
  }
  return corners;
}

std::vector<Point2> boxCorners(const Pose2& T_map_box, double size_x_m, double size_y_m) {
  const double hx = 0.5 * size_x_m;
  const double hy = 0.5 * size_y_m;
  return {
      transform(T_map_box, {-hx, -hy}),
      transform(T_map_box, {hx, -hy}),
      transform(T_map_box, {hx, hy}),
      transform(T_map_box, {-hx, hy})};
}

/// Share of its opening that a door fills at a time.
double closedShare(const Door& door, double time_s) {
  double share = door.open ? 0.0 : 1.0;
  for (const DoorChange& change : door.changes) {
    if (time_s < change.at_s) break;
    const double target = change.open ? 0.0 : 1.0;
    const double done = std::min(1.0, (time_s - change.at_s) / change.over_s);
    share += done * (target - share);
  }
  return share;
}

/// Where a mover is; heading along its way.
Pose2 poseOf(const Mover& mover, double time_s) {
  std::vector<Point2> way = mover.path;
  if (mover.round) way.push_back(way.front());
  double length_m = 0.0;
  for (std::size_t i = 0; i + 1 < way.size(); ++i) {
    length_m += std::hypot(way[i + 1].x - way[i].x, way[i + 1].y - way[i].y);
  }
  const double lap_s = length_m / mover.speed_mps + mover.pause_s;
  const double driving_s = std::max(time_s - mover.start_s, 0.0);
  const double laps = std::floor(driving_s / lap_s);
  double covered_m = std::min((driving_s - laps * lap_s) * mover.speed_mps, length_m);
  const bool back = !mover.round && std::fmod(laps, 2.0) == 1.0;
  if (back) covered_m = length_m - covered_m;
  for (std::size_t i = 0; i + 1 < way.size(); ++i) {
    const double dx = way[i + 1].x - way[i].x;
    const double dy = way[i + 1].y - way[i].y;
    const double part_m = std::hypot(dx, dy);
    if (covered_m <= part_m || i + 2 == way.size()) {
      const double s = part_m > 0.0 ? std::min(covered_m / part_m, 1.0) : 0.0;
      const double yaw_rad = std::atan2(dy, dx);
      return {way[i].x + s * dx, way[i].y + s * dy, back ? wrapToPi(yaw_rad + kPi) : yaw_rad};
    }
    covered_m -= part_m;
  }
  return {way.back().x, way.back().y, 0.0};
}

/// The edges between dark and other cells, straight runs joined.
void addImage(std::vector<Segment>& segments, const OccupancyImage& source) {
  // Through memory: cv::imread prints its own complaint about a missing file.
  std::ifstream file(source.image, std::ios::binary);
  const std::vector<char> bytes{
      std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  cv::Mat picture;
  if (!bytes.empty()) picture = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
  if (picture.empty()) {
    throw InputError(
        source.image + ": cannot read the occupancy image of the world; expected PNG or PGM");
  }
  const auto dark = [&](int ix, int iy) {  // iy from the bottom
    if (ix < 0 || iy < 0 || ix >= picture.cols || iy >= picture.rows) return false;
    const double white = picture.at<std::uint8_t>(picture.rows - 1 - iy, ix) / 255.0;
    return (source.negate ? 1.0 - white : white) < source.occupied_below;
  };
  const auto add = [&](int ax, int ay, int bx, int by) {
    const double r = source.resolution_m;
    segments.push_back(
        {transform(source.T_map_image, {ax * r, ay * r}),
         transform(source.T_map_image, {bx * r, by * r}),
         0.0,
         source.height_m});
  };
  for (int iy = 0; iy <= picture.rows; ++iy) {  // horizontal edges, below row iy
    int start = -1;
    for (int ix = 0; ix <= picture.cols; ++ix) {
      const bool edge = ix < picture.cols && dark(ix, iy) != dark(ix, iy - 1);
      if (edge && start < 0) start = ix;
      if (!edge && start >= 0) {
        add(start, iy, ix, iy);
        start = -1;
      }
    }
  }
  for (int ix = 0; ix <= picture.cols; ++ix) {  // vertical edges, left of column ix
    int start = -1;
    for (int iy = 0; iy <= picture.rows; ++iy) {
      const bool edge = iy < picture.rows && dark(ix, iy) != dark(ix - 1, iy);
      if (edge && start < 0) start = iy;
      if (!edge && start >= 0) {
        add(ix, start, ix, iy);
        start = -1;
      }
    }
  }
}

double pointToSegment(double px, double py, double ax, double ay, double dx, double dy) {
  const double length2 = dx * dx + dy * dy;
  const double s =
      length2 > 0.0 ? std::clamp(((px - ax) * dx + (py - ay) * dy) / length2, 0.0, 1.0) : 0.0;
  return std::hypot(px - ax - s * dx, py - ay - s * dy);
}

/// Distance between the rectangle |x| <= hx, |y| <= hy and the segment from a along d; 0 when they
/// touch.
double rectangleToSegment(double hx, double hy, double ax, double ay, double dx, double dy) {
  // Liang-Barsky: the part of the segment inside all four half planes.
  double s0 = 0.0;
  double s1 = 1.0;
  const auto clip = [&](double p, double q) {
    if (p == 0.0) return q >= 0.0;
    const double s = q / p;
    if (p < 0.0) s0 = std::max(s0, s);
    if (p > 0.0) s1 = std::min(s1, s);
    return s0 <= s1;
  };
  if (clip(-dx, ax + hx) && clip(dx, hx - ax) && clip(-dy, ay + hy) && clip(dy, hy - ay)) {
    return 0.0;
  }
  // Apart: the closest pair contains an end of the segment or a corner of the rectangle.
  const auto end_to_rectangle = [&](double x, double y) {
    return std::hypot(std::max(std::abs(x) - hx, 0.0), std::max(std::abs(y) - hy, 0.0));
  };
  double nearest = std::min(end_to_rectangle(ax, ay), end_to_rectangle(ax + dx, ay + dy));
  for (const double x : {-hx, hx}) {
    for (const double y : {-hy, hy}) {
      nearest = std::min(nearest, pointToSegment(x, y, ax, ay, dx, dy));
    }
  }
  return nearest;
}

}  // namespace

namespace {

/// Where a level ray from (ox, oy) along the unit vector (dx, dy) crosses a line [m]; infinite if
/// it does not.
template <class Line>
double crossing(const Line& line, double ox, double oy, double dx, double dy) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const double determinant = dx * line.dy - dy * line.dx;
  if (determinant == 0.0) return kNever;  // parallel; its ends belong to the neighbouring lines
  const double rx = line.ax - ox;
  const double ry = line.ay - oy;
  const double inverse = 1.0 / determinant;
  const double range = (rx * line.dy - ry * line.dx) * inverse;
  if (range < 0.0) return kNever;
  const double s = (rx * dy - ry * dx) * inverse;
  // A hair of overlap closes the corner between two lines.
  return s >= -1e-9 && s <= 1.0 + 1e-9 ? range : kNever;
}

}  // namespace

struct WorldGeometry::Dynamics {
  std::vector<Door> doors;  // those that move
  std::vector<Mover> movers;
  Terrain terrain;
  std::optional<GroundRays> ground_rays;  // of `terrain`
  GroundClass ground;
  std::vector<GroundArea> areas;
};

std::vector<Segment> segmentsOf(const World& world) {
  std::vector<Segment> segments;
  const Terrain& terrain = world.terrain;
  for (const Wall& wall : world.walls) {
    for (std::size_t i = 0; i + 1 < wall.points.size(); ++i) {
      segments.push_back(faceOf(wall, terrain, wall.points[i], wall.points[i + 1]));
    }
    if (wall.closed && wall.points.size() > 2) {
      segments.push_back(faceOf(wall, terrain, wall.points.back(), wall.points.front()));
    }
  }
  for (const Box& box : world.boxes) {
    const Pose2 T_map_box{box.centre.x, box.centre.y, box.yaw_rad};
    addLoop(segments, box, terrain, boxCorners(T_map_box, box.size_x_m, box.size_y_m));
  }
  for (const Circle& circle : world.circles) {
    addLoop(
        segments, circle, terrain, circleCorners(circle.centre, circle.radius_m, kCircleCorners));
  }
  if (world.occupancy_image) addImage(segments, *world.occupancy_image);
  for (const Door& door : world.doors) {
    if (door.open || !door.changes.empty()) continue;
    const double ground_m = terrain.height(door.shape.centre());
    segments.push_back(
        {door.shape.a, door.shape.b, ground_m, ground_m + door.height_m, Material::kSolid});
  }
  return segments;
}

WorldGeometry::~WorldGeometry() = default;

WorldGeometry::WorldGeometry(const World& world) {
  auto dynamics = std::make_unique<Dynamics>();
  for (const Door& door : world.doors) {
    if (!door.changes.empty()) dynamics->doors.push_back(door);
  }
  dynamics->movers = world.movers;
  dynamics->terrain = world.terrain;
  dynamics->ground_rays.emplace(dynamics->terrain);
  dynamics->ground = world.ground;
  dynamics->areas = world.ground_areas;
  for (const Building& building : world.buildings) {
    if (!building.roof) continue;
    Point2 centre{0.0, 0.0};
    for (const Point2& p : building.shape.outline) {
      centre = centre + p / static_cast<double>(building.shape.outline.size());
    }
    const double height_m = building.roof_height_m + std::max(0.0, world.terrain.height(centre));
    roofs_.push_back({building.shape.outline, height_m});
    top_m_ = std::max(top_m_, height_m);
  }
  for (const Mover& mover : world.movers) top_m_ = std::max(top_m_, mover.height_m);
  for (const Door& door : world.doors) top_m_ = std::max(top_m_, door.height_m);
  dynamics_ = std::move(dynamics);
  segments_ = segmentsOf(world);
  fillGrid();
}

WorldGeometry::WorldGeometry(std::vector<Segment> segments) : segments_(std::move(segments)) {
  fillGrid();
}

WorldGeometry::Line WorldGeometry::lineOf(const Segment& s) {
  return {s.a.x, s.a.y, s.b.x - s.a.x, s.b.y - s.a.y, s.z_low_m, s.z_high_m, s.material};
}

bool WorldGeometry::isInTheWay(const Segment& s) const {
  // Below a robot's belly and above its mast nothing is in its way.
  constexpr double kBelly_m = 0.02;
  constexpr double kMast_m = 1.2;
  const double ground_m = groundHeight({0.5 * (s.a.x + s.b.x), 0.5 * (s.a.y + s.b.y)});
  return s.z_low_m < ground_m + kMast_m && s.z_high_m > ground_m + kBelly_m;
}

void WorldGeometry::fillGrid() {
  for (const Segment& s : segments_) {
    if (std::isfinite(s.z_high_m)) top_m_ = std::max(top_m_, s.z_high_m);
    all_lines_.push_back(lineOf(s));
    all_lines_.back().in_the_way = isInTheWay(s);
  }
  first_.assign(1, 0);
  if (segments_.empty()) return;
  Point2 low = segments_.front().a;
  Point2 high = low;
  for (const Segment& s : segments_) {
    for (const Point2& p : {s.a, s.b}) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
  }
  // A margin of half a cell keeps every line off the border, where rounding could lose it.
  cell_m_ =
      std::max({kCell_m, (high.x - low.x) / kMaxCellsPerSide, (high.y - low.y) / kMaxCellsPerSide});
  inverse_cell_ = 1.0 / cell_m_;
  p_corner_ = {low.x - 0.5 * cell_m_, low.y - 0.5 * cell_m_};
  width_ = static_cast<int>((high.x - p_corner_.x) * inverse_cell_) + 2;
  height_ = static_cast<int>((high.y - p_corner_.y) * inverse_cell_) + 2;

  std::vector<std::vector<Line>> cells(
      static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    const Segment& s = segments_[i];
    const Line& line = all_lines_[i];
    const double length = std::hypot(line.dx, line.dy);
    const auto column = [&](double x) {
      return static_cast<int>(std::floor((x - p_corner_.x) * inverse_cell_));
    };
    const auto row = [&](double y) {
      return static_cast<int>(std::floor((y - p_corner_.y) * inverse_cell_));
    };
    constexpr double kSlack_m = 1e-6;
    const auto [x0, x1] = std::minmax(s.a.x, s.b.x);
    const auto [y0, y1] = std::minmax(s.a.y, s.b.y);
    for (int iy = row(y0 - kSlack_m); iy <= row(y1 + kSlack_m); ++iy) {
      for (int ix = column(x0 - kSlack_m); ix <= column(x1 + kSlack_m); ++ix) {
        // Separating axis: does the infinite line pass the cell?
        const double cx = p_corner_.x + (ix + 0.5) * cell_m_ - line.ax;
        const double cy = p_corner_.y + (iy + 0.5) * cell_m_ - line.ay;
        const double reach =
            0.5 * cell_m_ * (std::abs(line.dx) + std::abs(line.dy)) + kSlack_m * length;
        if (std::abs(cx * line.dy - cy * line.dx) > reach) continue;
        cells
            [static_cast<std::size_t>(iy) * static_cast<std::size_t>(width_) +
             static_cast<std::size_t>(ix)]
                .push_back(line);
      }
    }
  }
  first_.clear();
  for (const auto& cell : cells) {
    first_.push_back(lines_.size());
    lines_.insert(lines_.end(), cell.begin(), cell.end());
  }
  first_.push_back(lines_.size());
}

template <class Visit>
void WorldGeometry::walk(
    double ox_map, double oy_map, double dx, double dy, const double& limit_m, Visit visit) const {
  if (segments_.empty()) return;
  // Clip to the grid (slab method), then walk its cells (Amanatides & Woo 1987).
  const double ox = ox_map - p_corner_.x;
  const double oy = oy_map - p_corner_.y;
  double t = 0.0;
  double t_end = limit_m;
  const auto slab = [&](double o, double d, double size) {
    if (d == 0.0) return o >= 0.0 && o <= size;
    const double t_low = -o / d;
    const double t_high = (size - o) / d;
    t = std::max(t, std::min(t_low, t_high));
    t_end = std::min(t_end, std::max(t_low, t_high));
    return t <= t_end;
  };
  if (!slab(ox, dx, width_ * cell_m_) || !slab(oy, dy, height_ * cell_m_)) return;

  const auto cell_of = [&](double v, int count) {
    return std::clamp(static_cast<int>(v * inverse_cell_), 0, count - 1);
  };
  int ix = cell_of(ox + t * dx, width_);
  int iy = cell_of(oy + t * dy, height_);
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const int step_x = dx > 0.0 ? 1 : -1;
  const int step_y = dy > 0.0 ? 1 : -1;
  double next_x = dx == 0.0 ? kNever : ((ix + (dx > 0.0 ? 1 : 0)) * cell_m_ - ox) / dx;
  double next_y = dy == 0.0 ? kNever : ((iy + (dy > 0.0 ? 1 : 0)) * cell_m_ - oy) / dy;
  const double delta_x = dx == 0.0 ? kNever : cell_m_ / std::abs(dx);
  const double delta_y = dy == 0.0 ? kNever : cell_m_ / std::abs(dy);

  while (true) {
    const std::size_t cell = static_cast<std::size_t>(iy) * static_cast<std::size_t>(width_) +
                             static_cast<std::size_t>(ix);
    for (std::size_t i = first_[cell]; i < first_[cell + 1]; ++i) {
      const Line& line = lines_[i];
      const double range = crossing(line, ox_map, oy_map, dx, dy);
      if (range < limit_m) visit(line, range);
    }
    const double t_exit = std::min(next_x, next_y);
    if (limit_m <= t_exit || t_exit >= t_end) break;
    if (next_x < next_y) {
      ix += step_x;
      next_x += delta_x;
    } else {
      iy += step_y;
      next_y += delta_y;
    }
    if (ix < 0 || iy < 0 || ix >= width_ || iy >= height_) break;
  }
}

double WorldGeometry::castRay(
    const Point2& p_map_origin, double angle_rad, double max_range_m, double height_m) const {
  double best = max_range_m;
  const double z = groundHeight(p_map_origin) + height_m;
  walk(
      p_map_origin.x,
      p_map_origin.y,
      std::cos(angle_rad),
      std::sin(angle_rad),
      best,
      [&](const Line& line, double range) {
        if (z >= line.z_low && z <= line.z_high) best = range;
      });
  return best;
}

RayHit WorldGeometry::castRay(
    const Moment& moment,
    const Eigen::Vector3d& p_map_origin,
    const Eigen::Vector3d& direction_map,
    double max_range_m) const {
  RayHit best;
  best.range_m = max_range_m;
  const double flat = std::max(direction_map.head<2>().norm(), 1e-9);
  const double dx = direction_map.x() / flat;
  const double dy = direction_map.y() / flat;
  const double climb = direction_map.z() / flat;
  double limit_m = best.range_m * flat;  // over the ground
  const auto consider = [&](const Line& line, double range) {
    const double z = p_map_origin.z() + range * climb;
    if (z < line.z_low || z > line.z_high) return;
    limit_m = range;
    best.range_m = range / flat;
    best.hit = true;
    best.material = line.material;
    best.cos_incidence = flat * std::abs(dx * line.dy - dy * line.dx) /
                         std::sqrt(line.dx * line.dx + line.dy * line.dy);
  };
  walk(p_map_origin.x(), p_map_origin.y(), dx, dy, limit_m, consider);
  for (const Segment& face : moment.faces) {
    const Line line = lineOf(face);
    const double range = crossing(line, p_map_origin.x(), p_map_origin.y(), dx, dy);
    if (range < limit_m) consider(line, range);
  }
  // The ground last: a march over terrain need only go as far as the nearest face.
  const double ground_m = groundRange(p_map_origin, direction_map, best.range_m);
  if (ground_m < best.range_m) {
    best.range_m = ground_m;
    best.hit = true;
    best.material = Material::kGround;
    const Eigen::Vector3d p = p_map_origin + ground_m * direction_map;
    best.cos_incidence = std::abs(direction_map.dot(groundNormal({p.x(), p.y()})));
  }
  return best;
}

double WorldGeometry::groundRange(
    const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double max_range_m) const {
  if (flat()) {
    if (direction.z() >= 0.0) return max_range_m;
    const double range = -origin.z() / direction.z();
    return range >= 0.0 ? std::min(range, max_range_m) : max_range_m;
  }
  return dynamics_->ground_rays->range(origin, direction, max_range_m);
}

SkyPath WorldGeometry::skyPath(
    const Moment& moment,
    const Eigen::Vector3d& p_map_antenna,
    double azimuth_rad,
    double elevation_rad) const {
  SkyPath path;
  const double dx = std::cos(azimuth_rad);
  const double dy = std::sin(azimuth_rad);
  const double slope = std::max(std::tan(elevation_rad), 1e-3);
  // Behind this distance the signal is above everything.
  const double limit_m = std::max((top_m_ - p_map_antenna.z()) / slope, 0.0);
  const auto consider = [&](const Line& line, double range) {
    const double z = p_map_antenna.z() + range * slope;
    if (!(z >= line.z_low && z <= line.z_high)) return;
    (line.material == Material::kGlass     ? path.glass
     : line.material == Material::kFoliage ? path.foliage
                                           : path.wall) = true;
  };
  walk(p_map_antenna.x(), p_map_antenna.y(), dx, dy, limit_m, consider);
  for (const Segment& face : moment.faces) {
    const Line line = lineOf(face);
    const double range = crossing(line, p_map_antenna.x(), p_map_antenna.y(), dx, dy);
    if (range < limit_m) consider(line, range);
  }
  for (const Roof& roof : roofs_) {
    const double range = (roof.height_m - p_map_antenna.z()) / slope;
    if (range < 0.0) continue;
    const Point2 p{p_map_antenna.x() + range * dx, p_map_antenna.y() + range * dy};
    if (geo::contains(roof.outline, p)) path.roof = true;
  }
  return path;
}

Moment WorldGeometry::momentAt(double time_s) const {
  Moment moment;
  if (!dynamics_) return moment;
  struct Shape {
    double base_m;
    double height_m;
    Material material = Material::kSolid;
  };
  for (const Door& door : dynamics_->doors) {
    const double share = closedShare(door, time_s);
    if (share <= 0.0) continue;
    const Point2 end{
        door.shape.a.x + share * (door.shape.b.x - door.shape.a.x),
        door.shape.a.y + share * (door.shape.b.y - door.shape.a.y)};
    moment.faces.push_back(
        faceOf(Shape{0.0, door.height_m}, dynamics_->terrain, door.shape.a, end));
  }
  constexpr int kPersonCorners = 8;
  for (const Mover& mover : dynamics_->movers) {
    const Pose2 T = poseOf(mover, time_s);
    addLoop(
        moment.faces,
        Shape{0.0, mover.height_m},
        dynamics_->terrain,
        mover.person ? circleCorners({T.x, T.y}, mover.radius_m, kPersonCorners)
                     : boxCorners(T, mover.length_m, mover.width_m));
  }
  return moment;
}

bool WorldGeometry::flat() const { return !dynamics_ || dynamics_->terrain.flat(); }

double WorldGeometry::groundHeight(const Point2& p_map) const {
  return flat() ? 0.0 : dynamics_->terrain.height(p_map);
}

Eigen::Vector3d WorldGeometry::groundNormal(const Point2& p_map) const {
  if (flat()) return Eigen::Vector3d::UnitZ();
  constexpr double kReach_m = 0.02;
  const double along =
      groundHeight({p_map.x + kReach_m, p_map.y}) - groundHeight({p_map.x - kReach_m, p_map.y});
  const double across =
      groundHeight({p_map.x, p_map.y + kReach_m}) - groundHeight({p_map.x, p_map.y - kReach_m});
  return Eigen::Vector3d(-along, -across, 2.0 * kReach_m).normalized();
}

const GroundClass& WorldGeometry::groundAt(const Point2& p_map) const {
  static const GroundClass kPlain;
  if (!dynamics_) return kPlain;
  const GroundClass* ground = &dynamics_->ground;
  for (const GroundArea& area : dynamics_->areas) {
    if (geo::contains(area.outline, p_map)) ground = &area.ground;
  }
  return *ground;
}

double WorldGeometry::distanceToRoofs(const Point2& p_map) const {
  double nearest_m = std::numeric_limits<double>::max();
  for (const Roof& roof : roofs_) {
    nearest_m = std::min(nearest_m, geo::signedDistance(roof.outline, p_map));
  }
  return nearest_m;
}

template <class DistanceTo>
double WorldGeometry::nearest(const Point2& p, double slack_m, DistanceTo distance_to) const {
  double best = std::numeric_limits<double>::infinity();
  const double fx = (p.x - p_corner_.x) * inverse_cell_;
  const double fy = (p.y - p_corner_.y) * inverse_cell_;
  if (!(fx >= 0.0 && fy >= 0.0 && fx < width_ && fy < height_)) {
    for (const Line& line : all_lines_) best = std::min(best, distance_to(line));
    return best;
  }
  const int cx = static_cast<int>(fx);
  const int cy = static_cast<int>(fy);
  const int rings = std::max(width_, height_);
  for (int k = 0; k < rings; ++k) {
    // Everything outside the rings visited so far is at least this far from p.
    const double margin = std::min({fx - cx, cx + 1 - fx, fy - cy, cy + 1 - fy}) + k - 1;
    if (best <= margin * cell_m_ - slack_m) break;
    for (int iy = std::max(cy - k, 0); iy <= std::min(cy + k, height_ - 1); ++iy) {
      const bool whole_row = iy == cy - k || iy == cy + k;
      for (int ix = cx - k; ix <= cx + k; ix += whole_row ? 1 : std::max(2 * k, 1)) {
        if (ix < 0 || ix >= width_) continue;
        const std::size_t cell = static_cast<std::size_t>(iy) * static_cast<std::size_t>(width_) +
                                 static_cast<std::size_t>(ix);
        for (std::size_t i = first_[cell]; i < first_[cell + 1]; ++i) {
          best = std::min(best, distance_to(lines_[i]));
        }
      }
    }
  }
  return best;
}

double WorldGeometry::clearance(const Point2& p_map) const {
  return nearest(p_map, 0.0, [&](const Line& line) {
    return pointToSegment(p_map.x, p_map.y, line.ax, line.ay, line.dx, line.dy);
  });
}

double WorldGeometry::footprintClearance(
    const Pose2& T_map_base,
    double half_length_m,
    double half_width_m,
    const Moment& moment) const {
  const double c = std::cos(T_map_base.phi);
  const double s = std::sin(T_map_base.phi);
  const double radius = std::hypot(half_length_m, half_width_m);
  const auto distance_to = [&](const Line& line) {
    if (!line.in_the_way) return std::numeric_limits<double>::infinity();
    const double x = line.ax - T_map_base.x;
    const double y = line.ay - T_map_base.y;
    return rectangleToSegment(
        half_length_m,
        half_width_m,
        c * x + s * y,
        c * y - s * x,
        c * line.dx + s * line.dy,
        c * line.dy - s * line.dx);
  };
  double best = nearest({T_map_base.x, T_map_base.y}, radius, distance_to);
  for (const Segment& face : moment.faces) {
    if (isInTheWay(face)) best = std::min(best, distance_to(lineOf(face)));
  }
  return best;
}

bool WorldGeometry::footprintCollides(
    const Pose2& T_map_base,
    double half_length_m,
    double half_width_m,
    const Moment& moment) const {
  return footprintClearance(T_map_base, half_length_m, half_width_m, moment) <= 0.0;
}

}  // namespace vestibule::sim
