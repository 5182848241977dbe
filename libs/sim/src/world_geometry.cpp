#include "vestibule/sim/world_geometry.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/sim/world.hpp"

namespace vestibule::sim {
namespace {

constexpr int kCircleCorners = 24;
constexpr double kCell_m = 1.0;         // farm-like density: a handful of lines per used cell
constexpr int kMaxCellsPerSide = 2000;  // a larger world gets larger cells

void addLoop(std::vector<Segment>& segments, const std::vector<Point2>& corners) {
  for (std::size_t i = 0; i < corners.size(); ++i) {
    segments.push_back({corners[i], corners[(i + 1) % corners.size()]});
  }
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
    return picture.at<std::uint8_t>(picture.rows - 1 - iy, ix) < 255.0 * source.occupied_below;
  };
  const auto add = [&](int ax, int ay, int bx, int by) {
    const double r = source.resolution_m;
    segments.push_back(
        {transform(source.T_map_image, {ax * r, ay * r}),
         transform(source.T_map_image, {bx * r, by * r})});
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

std::vector<Segment> segmentsOf(const World& world) {
  std::vector<Segment> segments;
  for (const Wall& wall : world.walls) {
    for (std::size_t i = 0; i + 1 < wall.points.size(); ++i) {
      segments.push_back({wall.points[i], wall.points[i + 1]});
    }
    if (wall.closed && wall.points.size() > 2) {
      segments.push_back({wall.points.back(), wall.points.front()});
    }
  }
  for (const Box& box : world.boxes) {
    const Pose2 T_map_box{box.centre.x, box.centre.y, box.yaw_rad};
    const double hx = 0.5 * box.size_x_m;
    const double hy = 0.5 * box.size_y_m;
    addLoop(
        segments,
        {transform(T_map_box, {-hx, -hy}),
         transform(T_map_box, {hx, -hy}),
         transform(T_map_box, {hx, hy}),
         transform(T_map_box, {-hx, hy})});
  }
  for (const Circle& circle : world.circles) {
    // Corners outside, edge middles inside: the mean radius is the circle's.
    const double step = 2.0 * kPi / kCircleCorners;
    const double radius = circle.radius_m * 2.0 / (1.0 + std::cos(0.5 * step));
    std::vector<Point2> corners;
    for (int i = 0; i < kCircleCorners; ++i) {
      corners.push_back(
          {circle.centre.x + radius * std::cos(i * step),
           circle.centre.y + radius * std::sin(i * step)});
    }
    addLoop(segments, corners);
  }
  if (world.occupancy_image) addImage(segments, *world.occupancy_image);
  for (const Door& door : world.doors) {
    if (!door.open) segments.push_back({door.shape.a, door.shape.b});
  }
  return segments;
}

WorldGeometry::WorldGeometry(const World& world) : WorldGeometry(segmentsOf(world)) {
  constexpr double kRoof_m = 4.0;
  for (const Building& building : world.buildings) {
    if (building.roof) roofs_.push_back({building.shape.outline, kRoof_m});
    top_m_ = std::max(top_m_, kRoof_m);
  }
}

WorldGeometry::WorldGeometry(std::vector<Segment> segments) : segments_(std::move(segments)) {
  for (const Segment& s : segments_) {
    if (std::isfinite(s.z_high_m)) top_m_ = std::max(top_m_, s.z_high_m);
  }
  fillGrid();
}

void WorldGeometry::fillGrid() {
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
  for (const Segment& s : segments_) {
    const Line line{s.a.x, s.a.y, s.b.x - s.a.x, s.b.y - s.a.y};
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

double WorldGeometry::castRay(
    const Point2& p_map_origin, double angle_rad, double max_range_m) const {
  if (segments_.empty()) return max_range_m;
  const double dx = std::cos(angle_rad);
  const double dy = std::sin(angle_rad);
  // Clip to the grid (slab method), then walk its cells (Amanatides & Woo 1987).
  const double ox = p_map_origin.x - p_corner_.x;
  const double oy = p_map_origin.y - p_corner_.y;
  double t = 0.0;
  double t_end = max_range_m;
  const auto slab = [&](double o, double d, double size) {
    if (d == 0.0) return o >= 0.0 && o <= size;
    const double t_low = -o / d;
    const double t_high = (size - o) / d;
    t = std::max(t, std::min(t_low, t_high));
    t_end = std::min(t_end, std::max(t_low, t_high));
    return t <= t_end;
  };
  if (!slab(ox, dx, width_ * cell_m_) || !slab(oy, dy, height_ * cell_m_)) return max_range_m;

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

  double best = max_range_m;
  while (true) {
    const std::size_t cell = static_cast<std::size_t>(iy) * static_cast<std::size_t>(width_) +
                             static_cast<std::size_t>(ix);
    for (std::size_t i = first_[cell]; i < first_[cell + 1]; ++i) {
      const Line& line = lines_[i];
      const double determinant = dx * line.dy - dy * line.dx;
      if (determinant == 0.0) continue;  // parallel; its ends belong to the neighbouring lines
      const double rx = line.ax - p_map_origin.x;
      const double ry = line.ay - p_map_origin.y;
      const double inverse = 1.0 / determinant;
      const double range = (rx * line.dy - ry * line.dx) * inverse;
      if (range < 0.0 || range >= best) continue;
      const double s = (rx * dy - ry * dx) * inverse;
      // A hair of overlap closes the corner between two lines.
      if (s >= -1e-9 && s <= 1.0 + 1e-9) best = range;
    }
    const double t_exit = std::min(next_x, next_y);
    if (best <= t_exit || t_exit >= t_end) break;
    if (next_x < next_y) {
      ix += step_x;
      next_x += delta_x;
    } else {
      iy += step_y;
      next_y += delta_y;
    }
    if (ix < 0 || iy < 0 || ix >= width_ || iy >= height_) break;
  }
  return best;
}

Moment WorldGeometry::momentAt(double /*time_s*/) const { return {}; }

double WorldGeometry::groundHeight(const Point2& /*p_map*/) const { return 0.0; }

namespace {

/// Where a horizontal ray from the origin along the unit vector (dx, dy) crosses a face [m];
/// infinite if it does not.
double crossing(const Segment& s, double ox, double oy, double dx, double dy) {
  const double ex = s.b.x - s.a.x;
  const double ey = s.b.y - s.a.y;
  const double determinant = dx * ey - dy * ex;
  if (determinant == 0.0) return std::numeric_limits<double>::infinity();
  const double rx = s.a.x - ox;
  const double ry = s.a.y - oy;
  const double range = (rx * ey - ry * ex) / determinant;
  const double along = (rx * dy - ry * dx) / determinant;
  const bool met = range >= 0.0 && along >= -1e-9 && along <= 1.0 + 1e-9;
  return met ? range : std::numeric_limits<double>::infinity();
}

}  // namespace

RayHit WorldGeometry::castRay(
    const Moment& moment,
    const Eigen::Vector3d& p_map_origin,
    const Eigen::Vector3d& direction_map,
    double max_range_m) const {
  RayHit best;
  best.range_m = max_range_m;
  const double flat = direction_map.head<2>().norm();
  if (direction_map.z() < 0.0) {
    const double range = -p_map_origin.z() / direction_map.z();
    if (range >= 0.0 && range < best.range_m) {
      best = {range, true, Material::kGround, std::abs(direction_map.z())};
    }
  }
  if (flat < 1e-9) return best;
  const double dx = direction_map.x() / flat;
  const double dy = direction_map.y() / flat;
  const auto consider = [&](const Segment& s) {
    const double range = crossing(s, p_map_origin.x(), p_map_origin.y(), dx, dy) / flat;
    if (range >= best.range_m) return;
    const double z = p_map_origin.z() + range * direction_map.z();
    if (z < s.z_low_m || z > s.z_high_m) return;
    const double ex = s.b.x - s.a.x;
    const double ey = s.b.y - s.a.y;
    const double cosine = flat * std::abs(dx * ey - dy * ex) / std::hypot(ex, ey);
    best = {range, true, s.material, cosine};
  };
  for (const Segment& s : segments_) consider(s);
  for (const Segment& s : moment.faces) consider(s);
  return best;
}

SkyPath WorldGeometry::skyPath(
    const Moment& moment,
    const Eigen::Vector3d& p_map_antenna,
    double azimuth_rad,
    double elevation_rad) const {
  SkyPath path;
  const double dx = std::cos(azimuth_rad);
  const double dy = std::sin(azimuth_rad);
  const double slope = std::tan(elevation_rad);
  const auto consider = [&](const Segment& s) {
    const double range = crossing(s, p_map_antenna.x(), p_map_antenna.y(), dx, dy);
    const double z = p_map_antenna.z() + range * slope;
    if (!(z >= s.z_low_m && z <= s.z_high_m)) return;
    (s.material == Material::kGlass     ? path.glass
     : s.material == Material::kFoliage ? path.foliage
                                        : path.wall) = true;
  };
  for (const Segment& s : segments_) consider(s);
  for (const Segment& s : moment.faces) consider(s);
  for (const Roof& roof : roofs_) {
    const double range = (roof.height_m - p_map_antenna.z()) / slope;
    if (range < 0.0) continue;
    const Point2 p{p_map_antenna.x() + range * dx, p_map_antenna.y() + range * dy};
    if (geo::contains(roof.outline, p)) path.roof = true;
  }
  return path;
}

template <class DistanceTo>
double WorldGeometry::nearest(const Point2& p, double slack_m, DistanceTo distance_to) const {
  double best = std::numeric_limits<double>::infinity();
  const double fx = (p.x - p_corner_.x) * inverse_cell_;
  const double fy = (p.y - p_corner_.y) * inverse_cell_;
  if (!(fx >= 0.0 && fy >= 0.0 && fx < width_ && fy < height_)) {
    for (const Segment& s : segments_) {
      best = std::min(best, distance_to(Line{s.a.x, s.a.y, s.b.x - s.a.x, s.b.y - s.a.y}));
    }
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
    const Pose2& T_map_base, double half_length_m, double half_width_m) const {
  const double c = std::cos(T_map_base.phi);
  const double s = std::sin(T_map_base.phi);
  const double radius = std::hypot(half_length_m, half_width_m);
  return nearest({T_map_base.x, T_map_base.y}, radius, [&](const Line& line) {
    const double x = line.ax - T_map_base.x;
    const double y = line.ay - T_map_base.y;
    return rectangleToSegment(
        half_length_m,
        half_width_m,
        c * x + s * y,
        c * y - s * x,
        c * line.dx + s * line.dy,
        c * line.dy - s * line.dx);
  });
}

bool WorldGeometry::footprintCollides(
    const Pose2& T_map_base, double half_length_m, double half_width_m) const {
  return footprintClearance(T_map_base, half_length_m, half_width_m) <= 0.0;
}

}  // namespace vestibule::sim
