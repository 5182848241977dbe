#include "vestibule/amcl/tell_apart.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <tuple>

#include "scan_fit.hpp"

namespace vestibule::amcl {
namespace {

constexpr std::size_t kMostClaims = 10;
constexpr double kGoalSpacing_m = 1.0;
constexpr double kNearest_m = 2.0;  // the present view tells as much as one from nearer
constexpr int kRays = 72;
constexpr double kView_m = 10.0;    // most lidars see walls that far
constexpr double kDiffers_m = 0.5;  // ranges that differ by less are noise and furniture
// A view that differs in so many metres of surface is another one. A ray stands for as much as lies
// between it and the next: few of them reach the end of a corridor, but they say the most.
constexpr double kPlain_m = 4.0;
constexpr double kSettingOut_m = 4.0;  // costs as much as driving so far
constexpr double kTurnBack_m = 4.0;    // so does a half turn, and what lies behind has been seen
constexpr double kFirst_m = 1.0;       // of a way says where the robot has to turn
// Ways keep to the middle of corridors: one sees more there. A metre along a wall costs so much
// more.
constexpr double kWide_m = 1.2;
constexpr double kNarrowCost = 2.0;
constexpr std::size_t kLongestLine = 100;  // cells of a way that may become a straight line
constexpr double kWorthIt = 0.10;          // of all that could be told apart
// Candidates so near to each other are one place, known badly.
constexpr double kSame_m = 1.0;
constexpr double kSame_rad = degToRad(20.0);

grid::OccupancyMap withoutSmallThings(const grid::OccupancyMap& map, double small_m) {
  const SmallThings small(map, small_m);
  std::vector<grid::Cell> cells;
  for (int y = 0; y < map.height(); ++y) {
    for (int x = 0; x < map.width(); ++x) {
      const bool moves = map.cell(x, y) == grid::Cell::kOccupied && small.at(cells.size()) != 0;
      cells.push_back(moves ? grid::Cell::kFree : map.cell(x, y));
    }
  }
  return grid::OccupancyMap::fromCells(
      map.width(), map.height(), map.resolution(), map.corner(), cells, map.T_map_grid());
}

/// With walls where nothing is known.
grid::OccupancyMap withoutUnknown(const grid::OccupancyMap& map) {
  std::vector<grid::Cell> cells;
  for (int y = 0; y < map.height(); ++y) {
    for (int x = 0; x < map.width(); ++x) {
      cells.push_back(
          map.cell(x, y) == grid::Cell::kUnknown ? grid::Cell::kOccupied : map.cell(x, y));
    }
  }
  return grid::OccupancyMap::fromCells(
      map.width(), map.height(), map.resolution(), map.corner(), cells, map.T_map_grid());
}

}  // namespace

TellApart::TellApart(
    std::shared_ptr<const grid::OccupancyMap> map, double radius_m, const GlobalParams& params)
    : map_(std::move(map)),
      distances_(*map_),
      fixed_(withoutSmallThings(*map_, params.small_m)),
      fixed_distances_(fixed_),
      rays_(withoutUnknown(fixed_)),
      radius_m_(radius_m) {}

grid::Cell TellApart::cell(std::size_t i) const {
  const auto w = static_cast<std::size_t>(map_->width());
  return map_->cell(static_cast<int>(i % w), static_cast<int>(i / w));
}

double TellApart::clearance(std::size_t i) const {
  return distances_.cells().empty() ? kView_m : static_cast<double>(distances_.cells()[i]);
}

double TellApart::costOf(std::size_t i) const {
  return 1.0 + kNarrowCost * std::max(0.0, 1.0 - clearance(i) / kWide_m);
}

bool TellApart::open(std::size_t i) const {
  return cell(i) == grid::Cell::kFree && clearance(i) > radius_m_;
}

std::vector<TellApart::Look> TellApart::view(const Point2& p_map, double yaw) const {
  std::vector<Look> looks;
  for (int i = 0; i < kRays; ++i) {
    const double direction = yaw + 2.0 * kPi * i / kRays;
    const double known_m = rays_.range(p_map, direction, kView_m);
    const Point2 end{
        p_map.x + known_m * std::cos(direction), p_map.y + known_m * std::sin(direction)};
    // Away from every obstacle it is the end of what is known.
    const bool ends =
        known_m >= kView_m || fixed_distances_.at(end, kView_m) < 1.5 * map_->resolution();
    looks.push_back({known_m, ends});
  }
  return looks;
}

double TellApart::difference(const std::vector<Look>& a, const std::vector<Look>& b) {
  if (a.empty() || b.empty()) return a.empty() == b.empty() ? 0.0 : 1.0;
  double differ_m = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    // A look that ends where the map knows nothing may go on.
    if ((a[i].ends && b[i].range_m > a[i].range_m + kDiffers_m) ||
        (b[i].ends && a[i].range_m > b[i].range_m + kDiffers_m)) {
      differ_m += std::min(a[i].range_m, b[i].range_m) * (2.0 * kPi / kRays);
    }
  }
  return std::min(1.0, differ_m / kPlain_m);
}

double TellApart::told(const std::vector<Claim>& claims, const Point2& p_map) const {
  std::vector<std::vector<Look>> views;
  for (const Claim& claim : claims) {
    const Point2 p = transform(claim.T_claim_best, p_map);
    // Within an obstacle there is no view: the robot would not get there, and notice on the way.
    const bool stuck = fixed_distances_.at(p, kView_m) < 0.5 * radius_m_;
    views.push_back(stuck ? std::vector<Look>() : view(p, claim.T_claim_best.phi));
  }
  double differs = 0.0;
  double all = 0.0;
  for (std::size_t i = 0; i < claims.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double weight = claims[i].share * claims[j].share;
      differs += weight * difference(views[i], views[j]);
      all += weight;
    }
  }
  return differs / all;
}

std::vector<Point2> TellApart::way(const std::vector<Place>& places, double reach_m) const {
  if (places.size() < 2) return {};
  const Pose2& best = places.front().T_map_base.mean;
  // Weights of candidates say too much while few scans have been seen.
  std::vector<Claim> claims;
  for (const Place& place : places) {
    if (claims.size() == kMostClaims) break;
    const Pose2& T = place.T_map_base.mean;
    if (!claims.empty() && distance(T, best) < kSame_m &&
        std::abs(angleDiff(T.phi, best.phi)) < kSame_rad) {
      continue;
    }
    claims.push_back({compose(T, inverse(best)), std::sqrt(place.weight)});
  }
  if (claims.size() < 2 || claims[1].share <= 0.0) return {};

  const auto w = static_cast<std::size_t>(map_->width());
  const auto h = static_cast<std::size_t>(map_->height());
  const double cell_m = map_->resolution();
  const auto centre_of = [&](std::size_t cell) {
    return transform(
        map_->T_map_grid(),
        {map_->corner().x + (static_cast<double>(cell % w) + 0.5) * cell_m,
         map_->corner().y + (static_cast<double>(cell / w) + 0.5) * cell_m});
  };
  const Point2 p = transform(inverse(map_->T_map_grid()), {best.x, best.y});
  const double u = (p.x - map_->corner().x) / cell_m;
  const double v = (p.y - map_->corner().y) / cell_m;
  if (!(u >= 0.0 && v >= 0.0 && u < static_cast<double>(w) && v < static_cast<double>(h))) {
    return {};
  }
  const auto start = static_cast<std::size_t>(v) * w + static_cast<std::size_t>(u);
  constexpr std::size_t kUnseen = static_cast<std::size_t>(-1);
  std::vector<std::size_t> came_from(w * h, kUnseen);
  std::vector<float> cost(w * h, std::numeric_limits<float>::infinity());
  struct Reached {
    float cost;  // of the way, more where it is narrow
    std::size_t cell;
    double way_m;
    double turn_m;  // what it costs to turn there from where the robot faces
    bool operator>(const Reached& o) const {
      return std::tie(cost, cell) > std::tie(o.cost, o.cell);
    }
  };
  std::priority_queue<Reached, std::vector<Reached>, std::greater<>> reached;
  came_from[start] = start;
  cost[start] = 0.0F;
  reached.push({0.0F, start, 0.0, 0.0});
  const auto turn_to = [&](std::size_t i) {
    const Point2 first = centre_of(i);
    const double bearing = std::atan2(first.y - best.y, first.x - best.x);
    return kTurnBack_m / kPi * std::abs(angleDiff(bearing, best.phi));
  };
  const auto spacing = std::max<std::size_t>(1, static_cast<std::size_t>(kGoalSpacing_m / cell_m));
  double most = 0.0;
  std::size_t goal = start;
  while (!reached.empty()) {
    const Reached at = reached.top();
    reached.pop();
    if (at.cost > cost[at.cell]) continue;
    const double price_m = at.way_m + at.turn_m + kSettingOut_m;
    const bool may_be_best = at.way_m >= kNearest_m && most * price_m < 1.0;
    if (may_be_best && (at.cell % w) % spacing == 0 && (at.cell / w) % spacing == 0) {
      const double tells = told(claims, centre_of(at.cell));
      if (tells >= kWorthIt && tells > most * price_m) {
        most = tells / price_m;
        goal = at.cell;
      }
    }
    if (at.way_m + cell_m > reach_m) continue;
    const std::size_t ix = at.cell % w;
    const std::size_t iy = at.cell / w;
    const auto visit = [&](std::size_t i, double step_m) {
      // The robot may stand nearer to an obstacle than it would go by itself.
      if (cell(i) == grid::Cell::kOccupied || (!open(i) && at.way_m > 2.0 * radius_m_)) return;
      const float through = at.cost + static_cast<float>(step_m * costOf(i));
      if (through >= cost[i]) return;
      cost[i] = through;
      came_from[i] = at.cell;
      const bool sets_out = at.way_m < kFirst_m && at.way_m + step_m >= kFirst_m;
      reached.push({through, i, at.way_m + step_m, sets_out ? turn_to(i) : at.turn_m});
    };
    const std::size_t x0 = ix > 0 ? ix - 1 : ix;
    const std::size_t y0 = iy > 0 ? iy - 1 : iy;
    for (std::size_t y = y0; y <= std::min(iy + 1, h - 1); ++y) {
      for (std::size_t x = x0; x <= std::min(ix + 1, w - 1); ++x) {
        visit(y * w + x, x != ix && y != iy ? std::sqrt(2.0) * cell_m : cell_m);
      }
    }
  }
  std::vector<std::size_t> cells;
  for (std::size_t i = goal; i != start; i = came_from[i]) cells.push_back(i);
  cells.push_back(start);
  std::reverse(cells.begin(), cells.end());
  std::vector<Point2> way;
  for (const std::size_t i : shortened(cells, cost)) way.push_back(centre_of(i));
  way.erase(way.begin());
  return way;
}

std::vector<std::size_t> TellApart::shortened(
    const std::vector<std::size_t>& way, const std::vector<float>& cost) const {
  const auto w = static_cast<std::size_t>(map_->width());
  const auto x = [&](std::size_t i) { return static_cast<double>(i % w); };
  const auto y = [&](std::size_t i) { return static_cast<double>(i / w); };
  std::vector<std::size_t> shorter{way.front()};
  for (std::size_t from = 0; from + 1 < way.size();) {
    std::vector<std::size_t> line;
    std::size_t to = std::min(way.size() - 1, from + kLongestLine);
    for (; to > from + 1; --to) {
      const double dx = x(way[to]) - x(way[from]);
      const double dy = y(way[to]) - y(way[from]);
      const double cells = std::max(std::abs(dx), std::abs(dy));
      const double step_m = std::hypot(dx, dy) / cells * map_->resolution();
      const auto allowed = static_cast<double>(cost[way[to]] - cost[way[from]]);
      double costs = 0.0;
      line.clear();
      for (double k = 1.0; k <= cells && costs <= allowed; ++k) {
        const auto u = static_cast<std::size_t>(std::lround(x(way[from]) + k / cells * dx));
        const auto v = static_cast<std::size_t>(std::lround(y(way[from]) + k / cells * dy));
        const std::size_t i = v * w + u;
        costs = open(i) ? costs + step_m * costOf(i) : std::numeric_limits<double>::infinity();
        line.push_back(i);
      }
      if (costs <= allowed) break;
    }
    if (to == from + 1) line = {way[to]};
    shorter.insert(shorter.end(), line.begin(), line.end());
    from = to;
  }
  return shorter;
}

}  // namespace vestibule::amcl
