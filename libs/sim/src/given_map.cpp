#include "vestibule/sim/given_map.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/sim/place_noise.hpp"
#include "vestibule/sim/world_geometry.hpp"

namespace vestibule::sim {
namespace {

constexpr std::uint64_t kSurveySeed = 1;  // the survey happened once; no run may change it
constexpr int kSurveyBeams = 1080;
constexpr double kWarpLength_m = 12.0;
constexpr int kMinHits = 2;              // fewer look like dirt and are left out
constexpr double kOccupiedShare = 0.12;  // of the beams that reached the cell

const Building& buildingOf(const World& world, const std::string& name) {
  return *std::find_if(world.buildings.begin(), world.buildings.end(), [&](const Building& b) {
    return b.shape.name == name;
  });
}

/// Poses every `spacing` along a polyline, its end included.
std::vector<Point2> sample(const std::vector<Point2>& path, double spacing_m) {
  std::vector<Point2> points;
  for (std::size_t i = 0; i + 1 < path.size(); ++i) {
    const double length_m = std::hypot(path[i + 1].x - path[i].x, path[i + 1].y - path[i].y);
    const int n = std::max(1, static_cast<int>(std::lround(length_m / spacing_m)));
    for (int k = i == 0 ? 0 : 1; k <= n; ++k) {
      const double s = static_cast<double>(k) / n;
      points.push_back(
          {path[i].x + s * (path[i + 1].x - path[i].x),
           path[i].y + s * (path[i + 1].y - path[i].y)});
    }
  }
  return points;
}

struct Counts {
  int hits = 0;
  int passes = 0;
};

/// Cells in the axes of the map picture.
class SurveyGrid {
 public:
  SurveyGrid(const Point2& low, const Point2& high, double resolution_m)
      : resolution_m_(resolution_m),
        corner_{
            std::floor(low.x / resolution_m) * resolution_m,
            std::floor(low.y / resolution_m) * resolution_m},
        width_(static_cast<int>(std::ceil((high.x - corner_.x) / resolution_m))),
        height_(static_cast<int>(std::ceil((high.y - corner_.y) / resolution_m))),
        counts_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_)) {}

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] const Point2& corner() const { return corner_; }
  [[nodiscard]] const Counts& at(int ix, int iy) const { return counts_[index(ix, iy)]; }
  [[nodiscard]] Point2 centre(int ix, int iy) const {
    return {corner_.x + (ix + 0.5) * resolution_m_, corner_.y + (iy + 0.5) * resolution_m_};
  }

  /// Counts a beam: each cell it passes once, its end cell as a hit where it met something.
  void add(const Point2& from, const Point2& to, bool hit) {
    // In units of cells; half-cell samples miss no more than clipped corners.
    const double x = (from.x - corner_.x) / resolution_m_;
    const double y = (from.y - corner_.y) / resolution_m_;
    const double dx = (to.x - from.x) / resolution_m_;
    const double dy = (to.y - from.y) / resolution_m_;
    const int n = static_cast<int>(2.0 * std::hypot(dx, dy));
    const std::ptrdiff_t end = cellOf(x + dx, y + dy);
    std::ptrdiff_t last = kOutside;
    for (int k = 0; k <= n; ++k) {
      const double s = static_cast<double>(k) / std::max(n, 1);
      const std::ptrdiff_t cell = cellOf(x + s * dx, y + s * dy);
      if (cell != last && cell != kOutside && !(hit && cell == end)) {
        ++counts_[static_cast<std::size_t>(cell)].passes;
      }
      last = cell;
    }
    if (hit && end != kOutside) ++counts_[static_cast<std::size_t>(end)].hits;
  }

 private:
  [[nodiscard]] std::size_t index(int ix, int iy) const {
    return static_cast<std::size_t>(iy) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(ix);
  }
  static constexpr std::ptrdiff_t kOutside = -1;
  [[nodiscard]] std::ptrdiff_t cellOf(double column, double row) const {
    if (column < 0.0 || row < 0.0 || column >= width_ || row >= height_) return kOutside;
    return static_cast<std::ptrdiff_t>(row) * width_ + static_cast<std::ptrdiff_t>(column);
  }

  double resolution_m_;
  Point2 corner_;
  int width_;
  int height_;
  std::vector<Counts> counts_;
};

}  // namespace

World worldAtSurvey(const World& world, const GivenMap& given) {
  World old = world;
  const auto is_removed = [&](const auto& object) {
    return !object.id.empty() &&
           std::find(given.removed.begin(), given.removed.end(), object.id) != given.removed.end();
  };
  const auto erase = [&](auto& objects) {
    objects.erase(std::remove_if(objects.begin(), objects.end(), is_removed), objects.end());
  };
  erase(old.walls);
  erase(old.boxes);
  erase(old.circles);
  for (const Move& move : given.moved) {
    for (Wall& wall : old.walls) {
      if (wall.id != move.id) continue;
      Point2 centre{0.0, 0.0};
      for (const Point2& p : wall.points)
        centre = centre + p / static_cast<double>(wall.points.size());
      for (Point2& p : wall.points) {
        const Point2 offset = transform(Pose2{0.0, 0.0, move.by.phi}, p - centre);
        p = {centre.x + move.by.x + offset.x, centre.y + move.by.y + offset.y};
      }
    }
    for (Box& box : old.boxes) {
      if (box.id != move.id) continue;
      box.centre = {box.centre.x + move.by.x, box.centre.y + move.by.y};
      box.yaw_rad = wrapToPi(box.yaw_rad + move.by.phi);
    }
    for (Circle& circle : old.circles) {
      if (circle.id != move.id) continue;
      circle.centre = {circle.centre.x + move.by.x, circle.centre.y + move.by.y};
    }
  }
  old.movers.clear();
  for (Door& door : old.doors) {
    door.changes.clear();
    const auto& changed = given.doors_changed;
    if (std::find(changed.begin(), changed.end(), door.shape.name) != changed.end()) {
      door.open = !door.open;
    }
  }
  old.boxes.insert(old.boxes.end(), given.boxes.begin(), given.boxes.end());
  old.circles.insert(old.circles.end(), given.circles.begin(), given.circles.end());
  return old;
}

grid::OccupancyMap surveyMap(const World& world, const GivenMap& given) {
  const WorldGeometry geometry(worldAtSurvey(world, given));
  const geo::Polygon& outline = buildingOf(world, given.building).shape.outline;
  std::vector<Point2> door_centres;
  for (const Door& door : world.doors) {
    constexpr double kOnOutline_m = 0.5;
    const Point2 centre = door.shape.centre();
    if (std::abs(geo::signedDistance(outline, centre)) < kOnOutline_m) {
      door_centres.push_back(centre);
    }
  }
  const Pose2 T_grid_map = inverse(given.T_map_grid);

  // The picture holds the building and the aprons, with a small margin.
  constexpr double kMargin_m = 0.5;
  Point2 low{1e9, 1e9};
  Point2 high{-1e9, -1e9};
  const auto cover = [&](const Point2& p_map, double around_m) {
    const Point2 p = transform(T_grid_map, p_map);
    low = {std::min(low.x, p.x - around_m), std::min(low.y, p.y - around_m)};
    high = {std::max(high.x, p.x + around_m), std::max(high.y, p.y + around_m)};
  };
  for (const Point2& corner : outline) cover(corner, kMargin_m);
  for (const Point2& centre : door_centres) cover(centre, given.apron_m + kMargin_m);
  SurveyGrid counts(low, high, given.resolution_m);

  // What a mapper believes lies a little off the truth, smoothly so.
  const std::uint64_t warp_seed = derivedSeed(kSurveySeed, "survey warp");
  const auto believed = [&](const Point2& p_map) {
    const Point2 warped{
        p_map.x + given.warp_m * placeNoise(warp_seed, 0, p_map, kWarpLength_m),
        p_map.y + given.warp_m * placeNoise(warp_seed, 1, p_map, kWarpLength_m)};
    return transform(T_grid_map, warped);
  };
  std::uint64_t scan = 0;
  for (const auto& path : given.survey_paths) {
    for (const Point2& p_map_laser : sample(path, given.pose_spacing_m)) {
      RandomStream random(kSurveySeed, "survey", scan++);
      const Point2 from = believed(p_map_laser);
      const double first_rad = random.uniform(0.0, 2.0 * kPi / kSurveyBeams);
      for (int beam = 0; beam < kSurveyBeams; ++beam) {
        const double angle_rad = first_rad + 2.0 * kPi * beam / kSurveyBeams;
        const double noise_m = random.normal(0.0, given.noise_m);
        double range_m = geometry.castRay(p_map_laser, angle_rad, given.range_m);
        const bool hit = range_m < given.range_m;
        if (hit) range_m = std::max(range_m + noise_m, 0.0);
        const Point2 end{
            p_map_laser.x + range_m * std::cos(angle_rad),
            p_map_laser.y + range_m * std::sin(angle_rad)};
        counts.add(from, believed(end), hit);
      }
    }
  }

  std::vector<grid::Cell> cells;
  cells.reserve(
      static_cast<std::size_t>(counts.width()) * static_cast<std::size_t>(counts.height()));
  for (int iy = 0; iy < counts.height(); ++iy) {
    for (int ix = 0; ix < counts.width(); ++ix) {
      const Counts& c = counts.at(ix, iy);
      const Point2 p_map = transform(given.T_map_grid, counts.centre(ix, iy));
      bool covered = geo::signedDistance(outline, p_map) < kMargin_m;
      for (const Point2& centre : door_centres) {
        covered = covered || std::hypot(p_map.x - centre.x, p_map.y - centre.y) < given.apron_m;
      }
      grid::Cell kind = grid::Cell::kUnknown;
      if (covered && c.hits >= kMinHits && c.hits >= kOccupiedShare * (c.hits + c.passes)) {
        kind = grid::Cell::kOccupied;
      } else if (covered && c.passes > 0) {
        kind = grid::Cell::kFree;
      }
      cells.push_back(kind);
    }
  }
  return grid::OccupancyMap::fromCells(
      counts.width(),
      counts.height(),
      given.resolution_m,
      counts.corner(),
      cells,
      given.T_map_grid);
}

}  // namespace vestibule::sim
