#include "scan_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace vestibule::amcl {
namespace {

constexpr double kFar_m = 1.0;          // distances are cut here: nothing to be attracted by
constexpr double kAttraction_m = 0.60;  // ends farther from any obstacle hit something unmapped
constexpr int kIterations = 8;
constexpr double kNeighbour_m = 0.20;
constexpr double kNeighbourSteps = 3.0;
// Of beams that graze a wall the ends lie far apart, on a line.
constexpr double kOnLine_m = 0.08;
constexpr double kGrazing_m = 1.5;
constexpr double kGrazingSteps = 14.0;  // of the beams' spacing there: 4 deg off the wall
// The steps between them differ by no more than 3 to 1; a stray end far from two near ones makes a
// line, too.
constexpr double kLeastStep = 0.22;  // of both
// A ray along a wall may clip it by a little. It is blocked only if its neighbours on both sides
// are, too, well before its end.
constexpr double kRaySide_m = 0.10;
constexpr double kRayMargin_m = 0.30;
// Smeared walls of some maps are as thick as this; deeper inside a block nothing can be seen.
constexpr double kThickWall_m = 1.0;
constexpr double kFitsBehind = 0.25;  // of a blocked beam
// Lidars promise a little more than they reach.
constexpr double kSureReach = 0.95;

}  // namespace

double Views::newsOf(const Point2& p) {
  const double n = ++views_[{std::lround(p.x / side_m_), std::lround(p.y / side_m_)}];
  return 1.0 / (n * n);
}

double Views::newsOf(const Point2& from, const Point2& to) {
  const double length = std::hypot(to.x - from.x, to.y - from.y);
  const int steps = std::max(1, static_cast<int>(length / side_m_));
  double news = 0.0;
  for (int i = 1; i <= steps; ++i) {
    const double t = static_cast<double>(i) / steps;
    news += newsOf({from.x + t * (to.x - from.x), from.y + t * (to.y - from.y)});
  }
  return news;
}

ScanEnds spreadEnds(
    const LaserScan& scan,
    double max_range_m,
    double spacing_m,
    std::size_t count,
    double small_m) {
  const std::size_t n = scan.ranges_m.size();
  std::vector<Point2> ends(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto range = static_cast<double>(scan.ranges_m[i]);
    ends[i] = transform(
        scan.T_base_laser, {range * std::cos(scan.angle(i)), range * std::sin(scan.angle(i))});
  }
  const auto usable = [&](std::size_t i) {
    return scan.valid(i) && static_cast<double>(scan.ranges_m[i]) <= max_range_m;
  };
  const auto on_line = [&](std::size_t i, std::size_t j, std::size_t k) {
    if (i >= n || k >= n || !usable(i) || !usable(k)) return false;
    const Point2 along{ends[k].x - ends[i].x, ends[k].y - ends[i].y};
    const double length = std::hypot(along.x, along.y);
    const double off = along.x * (ends[j].y - ends[i].y) - along.y * (ends[j].x - ends[i].x);
    const double before = std::hypot(ends[j].x - ends[i].x, ends[j].y - ends[i].y);
    const double after = std::hypot(ends[k].x - ends[j].x, ends[k].y - ends[j].y);
    return length < 3.0 * kGrazing_m && std::min(before, after) > kLeastStep * length &&
           std::max(before, after) < length && std::abs(off) < kOnLine_m * length;
  };
  const auto same_surface = [&](std::size_t i, std::size_t j) {
    const double apart = std::hypot(ends[i].x - ends[j].x, ends[i].y - ends[j].y);
    const double spacing = std::abs(scan.angle_step_rad) * static_cast<double>(scan.ranges_m[i]);
    if (apart < std::max(kNeighbour_m, kNeighbourSteps * spacing)) return true;
    if (apart > std::min(kGrazing_m, kGrazingSteps * spacing) || (j != i + 1 && i != j + 1)) {
      return false;
    }
    // Four in a row: by chance three are on a line more often than one may think.
    const std::size_t first = std::min(i, j);
    for (const std::size_t from : {first - 2, first - 1, first}) {
      if (on_line(from, from + 1, from + 2) && on_line(from + 1, from + 2, from + 3)) return true;
    }
    return false;
  };
  // A surface is hit by neighbouring beams; a lone end is dust, an edge or an error.
  const auto has_neighbour = [&](std::size_t i) {
    for (const std::size_t j : {i - 2, i - 1, i + 1, i + 2}) {
      if (j >= n || !usable(j)) continue;  // i - 1 wraps round to a large number
      if (same_surface(i, j)) return true;
    }
    return false;
  };
  std::vector<std::size_t> on_surfaces;
  for (std::size_t i = 0; i < n; ++i) {
    if (usable(i) && has_neighbour(i)) on_surfaces.push_back(i);
  }
  std::vector<char> stand_out(n, 0);
  for (std::size_t from = 0; from < on_surfaces.size();) {
    std::size_t to = from + 1;
    while (to < on_surfaces.size() && same_surface(on_surfaces[to - 1], on_surfaces[to])) ++to;
    const std::size_t first = on_surfaces[from];
    const std::size_t last = on_surfaces[to - 1];
    // What limits the view on either side is no thing that stands out.
    const bool inside = from > 0 && to < on_surfaces.size();
    if (inside && scan.ranges_m[on_surfaces[from - 1]] > scan.ranges_m[first] &&
        scan.ranges_m[on_surfaces[to]] > scan.ranges_m[last]) {
      double extent_m = 0.0;
      for (std::size_t k = from; k < to; ++k) {
        const Point2& p = ends[on_surfaces[k]];
        extent_m = std::max(
            {extent_m,
             std::hypot(p.x - ends[first].x, p.y - ends[first].y),
             std::hypot(p.x - ends[last].x, p.y - ends[last].y)});
      }
      if (extent_m <= small_m) {
        for (std::size_t k = from; k < to; ++k) stand_out[on_surfaces[k]] = 1;
      }
    }
    from = to;
  }
  ScanEnds spaced;
  bool broken = true;  // since the last end that was taken
  for (std::size_t k = 0; k < on_surfaces.size(); ++k) {
    const std::size_t i = on_surfaces[k];
    broken = broken || k == 0 || !same_surface(on_surfaces[k - 1], i);
    if (!spaced.p_base.empty() &&
        std::hypot(ends[i].x - spaced.p_base.back().x, ends[i].y - spaced.p_base.back().y) <
            spacing_m) {
      continue;
    }
    spaced.p_base.push_back(ends[i]);
    spaced.follows.push_back(broken ? 0 : 1);
    spaced.stand_out.push_back(stand_out[i]);
    broken = false;
  }
  if (spaced.p_base.size() <= count) return spaced;
  ScanEnds chosen;
  std::size_t last = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = k * spaced.p_base.size() / count;
    const bool follows = std::all_of(
        spaced.follows.begin() + static_cast<std::ptrdiff_t>(last + 1),
        spaced.follows.begin() + static_cast<std::ptrdiff_t>(i + 1),
        [](char f) { return f != 0; });
    chosen.p_base.push_back(spaced.p_base[i]);
    chosen.follows.push_back(k > 0 && follows ? 1 : 0);
    chosen.stand_out.push_back(spaced.stand_out[i]);
    last = i;
  }
  return chosen;
}

std::vector<Point2> spreadGaps(const LaserScan& scan, double max_range_m, std::size_t count) {
  const double reach_m = std::min(kSureReach * scan.range_max_m, max_range_m);
  // NaN and what is too short are errors, not free space.
  const auto nothing = [&](std::size_t i) {
    return i < scan.ranges_m.size() &&
           static_cast<double>(scan.ranges_m[i]) >= std::min(scan.range_max_m, max_range_m);
  };
  std::vector<Point2> gaps;
  for (std::size_t i = 1; i + 1 < scan.ranges_m.size(); ++i) {
    if (!nothing(i) || !(nothing(i - 1) || nothing(i + 1))) continue;
    gaps.push_back(transform(
        scan.T_base_laser, {reach_m * std::cos(scan.angle(i)), reach_m * std::sin(scan.angle(i))}));
  }
  if (gaps.size() <= count) return gaps;
  std::vector<Point2> chosen;
  for (std::size_t k = 0; k < count; ++k) chosen.push_back(gaps[k * gaps.size() / count]);
  return chosen;
}

namespace {

/// The number of a square of the map, below 0: what is in it and not mapped is taken for one thing.
std::int64_t squareAt(const Point2& p_cells, double side_m) {
  constexpr std::int64_t kPerRow = std::int64_t{1} << 30;
  const auto ix = static_cast<std::int64_t>(std::floor(p_cells.x / side_m));
  const auto iy = static_cast<std::int64_t>(std::floor(p_cells.y / side_m));
  return -kPerRow * kPerRow + kPerRow * iy + ix;
}

}  // namespace

SmallThings::SmallThings(const grid::OccupancyMap& map, double small_m) {
  const int w = map.width();
  const int h = map.height();
  const auto at = [w](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(w) + static_cast<std::size_t>(x);
  };
  std::uint32_t things = 0;
  std::vector<char> seen(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), 0);
  std::vector<std::pair<int, int>> thing;
  const auto around = [&](int x, int y, const auto& visit) {
    for (int v = std::max(0, y - 1); v <= std::min(h - 1, y + 1); ++v) {
      for (int u = std::max(0, x - 1); u <= std::min(w - 1, x + 1); ++u) visit(u, v);
    }
  };
  for (int y0 = 0; y0 < h; ++y0) {
    for (int x0 = 0; x0 < w; ++x0) {
      if (seen[at(x0, y0)] != 0 || map.cell(x0, y0) != grid::Cell::kOccupied) continue;
      thing.assign(1, {x0, y0});
      seen[at(x0, y0)] = 1;
      int left = x0;
      int right = x0;
      int top = y0;
      for (std::size_t next = 0; next < thing.size(); ++next) {
        const auto [x, y] = thing[next];
        left = std::min(left, x);
        right = std::max(right, x);
        top = std::max(top, y);
        around(x, y, [&](int u, int v) {
          if (seen[at(u, v)] != 0 || map.cell(u, v) != grid::Cell::kOccupied) return;
          seen[at(u, v)] = 1;
          thing.emplace_back(u, v);
        });
      }
      const double extent_m = map.resolution() * std::hypot(right - left + 1, top - y0 + 1);
      if (extent_m > small_m) continue;
      ++things;
      for (const auto& [x, y] : thing) {
        around(x, y, [&](int u, int v) { things_.emplace_back(at(u, v), things); });
      }
    }
  }
  std::sort(things_.begin(), things_.end());
  // Of several the last.
  const auto kept = std::unique(things_.rbegin(), things_.rend(), [](const auto& a, const auto& b) {
    return a.first == b.first;
  });
  things_.erase(things_.begin(), kept.base());
  things_.shrink_to_fit();
}

std::uint32_t SmallThings::at(std::size_t cell) const {
  const auto it = std::lower_bound(
      things_.begin(), things_.end(), cell, [](const auto& thing, std::size_t wanted) {
        return thing.first < wanted;
      });
  return it != things_.end() && it->first == cell ? it->second : 0;
}

ScanFitter::ScanFitter(
    const GlobalParams& params,
    const grid::OccupancyMap& map,
    std::shared_ptr<const grid::DistanceField> distances)
    : params_(params),
      map_(map),
      distances_(
          distances ? std::move(distances) : std::make_shared<const grid::DistanceField>(map)),
      rays_(map),
      movable_(map, params.small_m),
      width_(map.width()),
      height_(map.height()),
      resolution_m_(map.resolution()),
      T_map_cells_(compose(map.T_map_grid(), Pose2{map.corner().x, map.corner().y, 0.0})) {}

ScanFitter::Distance ScanFitter::interpolated(const Point2& p_grid) const {
  const double u = p_grid.x / resolution_m_ - 0.5;
  const double v = p_grid.y / resolution_m_ - 0.5;
  const std::vector<float>& d = distances_->cells();
  if (d.empty() || !(u >= 0.0 && v >= 0.0 && u < width_ - 1 && v < height_ - 1)) {
    return {kFar_m, 0.0, 0.0};
  }
  const auto ix = static_cast<std::size_t>(u);
  const auto iy = static_cast<std::size_t>(v);
  const double fx = u - static_cast<double>(ix);
  const double fy = v - static_cast<double>(iy);
  const float* row = d.data() + iy * static_cast<std::size_t>(width_) + ix;
  const auto d00 = static_cast<double>(row[0]);
  const auto d10 = static_cast<double>(row[1]);
  const auto d01 = static_cast<double>(row[width_]);
  const auto d11 = static_cast<double>(row[width_ + 1]);
  return {
      (1.0 - fy) * ((1.0 - fx) * d00 + fx * d10) + fy * ((1.0 - fx) * d01 + fx * d11),
      ((1.0 - fy) * (d10 - d00) + fy * (d11 - d01)) / resolution_m_,
      ((1.0 - fx) * (d01 - d00) + fx * (d11 - d10)) / resolution_m_};
}

PoseWithCovariance ScanFitter::refined(
    const ScanEnds& ends, const Pose2& T_map_base, const Eigen::Matrix3d& information) const {
  // In cell axes, where the gradients live.
  const Pose2 T_cells_map = inverse(T_map_cells_);
  const Eigen::Matrix3d info_cells =
      compose(T_cells_map, PoseWithCovariance{T_map_base, information}).cov;
  const Pose2 start = compose(T_cells_map, T_map_base);
  Pose2 T = start;
  const double sigma2 = params_.sigma_hit_m * params_.sigma_hit_m;
  const double tempering = params_.surface_share;
  Eigen::Matrix3d H = info_cells;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const double c = std::cos(T.phi);
    const double s = std::sin(T.phi);
    const Eigen::Vector3d off(T.x - start.x, T.y - start.y, angleDiff(T.phi, start.phi));
    Eigen::Vector3d g = info_cells * off;
    H = info_cells;
    for (std::size_t i = 0; i < ends.p_base.size(); ++i) {
      const Point2& p = ends.p_base[i];
      const Point2 q{T.x + c * p.x - s * p.y, T.y + s * p.x + c * p.y};
      const Distance d = interpolated(q);
      if (d.d_m >= kAttraction_m) continue;
      const double ratio = 3.0 * params_.sigma_hit_m / std::max(d.d_m, 1e-9);
      const double weight = tempering / sigma2 * std::min(1.0, ratio * ratio) *
                            (ends.stand_out[i] != 0 ? params_.movable_share : 1.0);
      const Eigen::Vector3d J(d.gx, d.gy, d.gx * (T.y - q.y) + d.gy * (q.x - T.x));
      H += weight * J * J.transpose();
      g += weight * d.d_m * J;
    }
    const Eigen::Matrix3d damped =
        H + Eigen::Vector3d(1e-3, 1e-3, 1e-3).asDiagonal().toDenseMatrix();
    const Eigen::Vector3d step = -damped.ldlt().solve(g);
    T = {T.x + step.x(), T.y + step.y(), wrapToPi(T.phi + step.z())};
    if (step.head<2>().norm() < 1e-3 && std::abs(step.z()) < 1e-4) break;
  }
  // Directions that neither scan nor information hold are known to a metre and some degrees.
  const Eigen::Matrix3d weak = Eigen::Vector3d(1.0, 1.0, 30.0).asDiagonal();
  return compose(T_map_cells_, PoseWithCovariance{T, (H + weak).inverse()});
}

std::optional<ScanFitter::CellIndex> ScanFitter::cellAt(const Point2& p_cells) const {
  const CellIndex i{
      static_cast<int>(std::floor(p_cells.x / resolution_m_)),
      static_cast<int>(std::floor(p_cells.y / resolution_m_))};
  if (i.x < 0 || i.y < 0 || i.x >= width_ || i.y >= height_) return std::nullopt;
  return i;
}

bool ScanFitter::isUnknown(const Point2& p_cells) const {
  const auto i = cellAt(p_cells);
  return i && map_.cell(i->x, i->y) == grid::Cell::kUnknown;
}

std::int64_t ScanFitter::thingAt(const Point2& p_map_obstacle) const {
  const auto i = cellAt(transform(inverse(T_map_cells_), p_map_obstacle));
  if (!i) return 0;
  return movable_.at(
      static_cast<std::size_t>(i->y) * static_cast<std::size_t>(width_) +
      static_cast<std::size_t>(i->x));
}

std::optional<Point2> ScanFitter::obstacleBefore(
    const Point2& p_map_end, const Point2& p_map_laser, double margin_m) const {
  const double yaw = std::atan2(p_map_end.y - p_map_laser.y, p_map_end.x - p_map_laser.x);
  const double c = std::cos(yaw);
  const double s = std::sin(yaw);
  const double reach_m =
      std::hypot(p_map_end.x - p_map_laser.x, p_map_end.y - p_map_laser.y) - margin_m;
  if (reach_m <= 0.0) return std::nullopt;
  // Some maps have thick walls, and beams end within them.
  const auto goes_on = [&](const Point2& from, double range_m) {
    const double thin_m = 1.5 * resolution_m_;
    if (reach_m + margin_m - range_m > kThickWall_m) return false;
    for (double at_m = range_m; at_m < reach_m + margin_m; at_m += resolution_m_) {
      const Point2 p = transform(inverse(T_map_cells_), {from.x + at_m * c, from.y + at_m * s});
      if (interpolated(p).d_m > thin_m) return false;
    }
    return true;
  };
  Point2 obstacle;
  double passed_m = -1.0;  // of the ray that gets farthest
  for (const double side_m : {0.0, kRaySide_m, -kRaySide_m}) {
    const Point2 from{p_map_laser.x - side_m * s, p_map_laser.y + side_m * c};
    const double range_m = rays_.range(from, yaw, reach_m);
    if (range_m >= reach_m) return std::nullopt;
    if (margin_m > 0.0 && goes_on(from, range_m)) return std::nullopt;
    if (range_m <= passed_m) continue;
    passed_m = range_m;
    obstacle = {from.x + range_m * c, from.y + range_m * s};
  }
  return obstacle;
}

ScanFit ScanFitter::fit(
    const ScanEnds& ends,
    const std::vector<double>& news,
    const std::vector<Point2>& gaps_base,
    const Point2& p_base_laser,
    const Pose2& T_map_base,
    Views& missing) const {
  ScanFit fit;
  if (ends.p_base.empty()) return fit;
  const Pose2 T_cells_base = compose(inverse(T_map_cells_), T_map_base);
  const Point2 p_map_laser = transform(T_map_base, p_base_laser);
  const double n = static_cast<double>(ends.p_base.size());
  const double log_blocked = std::log(params_.blocked_share);
  const auto note = [&](std::int64_t thing, double log_likelihood) {
    if (thing == 0) {
      fit.log_likelihood += log_likelihood;
    } else if (log_likelihood < 0.0) {
      fit.things.push_back({thing, log_likelihood});
    }
  };
  for (std::size_t i = 0; i < ends.p_base.size(); ++i) {
    const Point2& p = ends.p_base[i];
    const Point2 p_cells = transform(T_cells_base, p);
    const double d = interpolated(p_cells).d_m;
    const double u = d / params_.sigma_hit_m;
    // Where nobody has looked anything may stand.
    const bool unknown = isUnknown(p_cells);
    const double is_new = (news.empty() ? 1.0 : news[i]) * (unknown ? params_.movable_share : 1.0);
    const bool small = ends.stand_out[i] != 0 && d >= params_.inlier_distance_m;
    note(
        small ? squareAt(p_cells, std::max(params_.small_m, params_.surface_m)) : 0,
        is_new * params_.surface_share *
            std::log(params_.random_share + (1.0 - params_.random_share) * std::exp(-0.5 * u * u)));
    const auto obstacle = obstacleBefore(transform(T_map_base, p), p_map_laser, kRayMargin_m);
    if (obstacle) {
      const std::int64_t thing = thingAt(*obstacle);
      const double fixed_share = thing == 0 ? 1.0 : params_.movable_share;
      // An end on an obstacle behind another one: cluttered maps are like that.
      const bool fits_behind = d < params_.inlier_distance_m;
      fit.blocked_share += fixed_share * (fits_behind ? kFitsBehind : 1.0) / n;
      note(thing, missing.newsOf(*obstacle) * params_.surface_share * fixed_share * log_blocked);
    } else if (d < params_.inlier_distance_m) {
      fit.inlier_share += 1.0 / n;
    }
    if (obstacle || !unknown || d < params_.inlier_distance_m) fit.known_share += 1.0 / n;
  }
  const double log_no_echo = std::log(params_.no_echo_share);
  std::optional<Point2> last;
  for (const Point2& gap : gaps_base) {
    const auto obstacle = obstacleBefore(transform(T_map_base, gap), p_map_laser, 0.0);
    if (obstacle) {
      const bool follows = last && distance(*last, *obstacle) < kGrazing_m;
      const double is_new = follows ? missing.newsOf(*last, *obstacle) : missing.newsOf(*obstacle);
      const std::int64_t thing = thingAt(*obstacle);
      const double fixed_share = thing == 0 ? 1.0 : params_.movable_share;
      note(thing, is_new * params_.surface_share * fixed_share * log_no_echo);
    }
    last = obstacle;
  }
  return fit;
}

}  // namespace vestibule::amcl
