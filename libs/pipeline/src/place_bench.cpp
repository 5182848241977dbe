#include "vestibule/pipeline/place_bench.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <set>

#include "vestibule/amcl/localizer.hpp"
#include "vestibule/amcl/tell_apart.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/parallel.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/grid/distance_field.hpp"
#include "vestibule/grid/ray_caster.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/sim/given_map.hpp"
#include "vestibule/sim/world.hpp"
#include "vestibule/sim/world_geometry.hpp"

namespace vestibule::pipeline {
namespace {

constexpr double kAllowed_m = 20.0;
constexpr double kRight_m = 0.3;
constexpr double kRight_rad = degToRad(5.0);
constexpr double kRadius_m = 0.35;  // of the robot
constexpr double kTick_s = 0.1;
constexpr int kMaxTicks = 3000;
constexpr int kTicksPerScan = 2;
constexpr double kSpeed_mps = 0.5;
constexpr double kTurn_radps = degToRad(60.0);

/// Where a robot can go, by the map and in truth: one connected part.
class Ground {
 public:
  explicit Ground(const LostPlace& place) : map_(*place.map), open_(cellCount(), 0) {
    for (std::size_t i = 0; i < open_.size(); ++i) {
      const int ix = static_cast<int>(i % width());
      const int iy = static_cast<int>(i / width());
      const Point2 p = centreOf(i);
      open_[i] = map_.cell(ix, iy) == grid::Cell::kFree && place.inside(p) &&
                         place.clearance(p) > kRadius_m
                     ? 1
                     : 0;
    }
    std::vector<char> unseen = open_;
    for (std::size_t i = 0; i < unseen.size(); ++i) {
      if (unseen[i] == 0) continue;
      std::vector<std::size_t> part{i};
      unseen[i] = 0;
      for (std::size_t next = 0; next < part.size(); ++next) {
        forNeighbours(part[next], [&](std::size_t j) {
          if (unseen[j] == 0) return;
          unseen[j] = 0;
          part.push_back(j);
        });
      }
      if (part.size() > cells_.size()) cells_ = std::move(part);
    }
    if (cells_.empty()) {
      throw InputError(place.name + ": no free place in this map that a robot fits into");
    }
    std::fill(open_.begin(), open_.end(), 0);
    for (const std::size_t i : cells_) open_[i] = 1;
  }

  [[nodiscard]] Pose2 draw(RandomStream& rng) const {
    const Point2 p = centreOf(drawCell(rng));
    return {p.x, p.y, rng.uniform(-kPi, kPi)};
  }
  [[nodiscard]] std::size_t drawCell(RandomStream& rng) const {
    return cells_[static_cast<std::size_t>(rng.uniform() * static_cast<double>(cells_.size()))];
  }
  /// Steps to the goal from every cell; -1 where it cannot be reached.
  [[nodiscard]] std::vector<int> stepsTo(std::size_t goal) const {
    std::vector<int> steps(open_.size(), -1);
    std::vector<std::size_t> front{goal};
    steps[goal] = 0;
    for (std::size_t next = 0; next < front.size(); ++next) {
      forNeighbours(front[next], [&](std::size_t j) {
        if (open_[j] == 0 || steps[j] >= 0) return;
        steps[j] = steps[front[next]] + 1;
        front.push_back(j);
      });
    }
    return steps;
  }
  /// A point some way down the steps from the cell nearest to p; empty at the goal.
  [[nodiscard]] std::optional<Point2> ahead(const std::vector<int>& steps, const Point2& p) const {
    std::size_t i = nearestOpen(p);
    const int wanted = steps[i] - static_cast<int>(0.5 / map_.resolution());
    if (wanted <= 0) return std::nullopt;
    while (steps[i] > wanted) {
      std::size_t best = i;
      forNeighbours(i, [&](std::size_t j) {
        if (steps[j] >= 0 && steps[j] < steps[best]) best = j;
      });
      i = best;
    }
    return centreOf(i);
  }
  /// A point a little on the way to another near one, around what stands between; empty when that
  /// is blocked or reached.
  [[nodiscard]] std::optional<Point2> towards(const Point2& from, const Point2& to) const {
    constexpr double kAround_m = 1.5;
    constexpr double kNearer_m = 0.1;
    struct Reached {
      std::size_t cell;
      std::size_t before;  // in the list
      int steps;
    };
    std::vector<Reached> reached{{nearestOpen(from), 0, 0}};
    std::set<std::size_t> seen{reached.front().cell};
    const auto off = [&](std::size_t i) {
      return std::hypot(centreOf(i).x - to.x, centreOf(i).y - to.y);
    };
    std::size_t best = 0;
    for (std::size_t next = 0; next < reached.size(); ++next) {
      const Reached at = reached[next];
      if (off(at.cell) < off(reached[best].cell)) best = next;
      if (at.steps * map_.resolution() > kAround_m) continue;
      forNeighbours(at.cell, [&](std::size_t j) {
        if (open_[j] != 0 && seen.insert(j).second) reached.push_back({j, next, at.steps + 1});
      });
    }
    if (off(reached[best].cell) > off(reached.front().cell) - kNearer_m) return std::nullopt;
    while (!straight(reached.front().cell, reached[best].cell)) best = reached[best].before;
    return centreOf(reached[best].cell);
  }

 private:
  /// Whether all cells on the line between two are open, but for the first.
  [[nodiscard]] bool straight(std::size_t from, std::size_t to) const {
    const auto x = [&](std::size_t i) { return static_cast<double>(i % width()); };
    const auto y = [&](std::size_t i) { return static_cast<double>(i / width()); };
    const double steps = 2.0 * std::max(std::abs(x(to) - x(from)), std::abs(y(to) - y(from)));
    for (double k = 1.0; k <= steps; ++k) {
      const double u = x(from) + k / steps * (x(to) - x(from));
      const double v = y(from) + k / steps * (y(to) - y(from));
      const auto i = static_cast<std::size_t>(std::lround(v)) * width() +
                     static_cast<std::size_t>(std::lround(u));
      if (open_[i] == 0 && i != from) return false;
    }
    return true;
  }
  [[nodiscard]] std::size_t width() const { return static_cast<std::size_t>(map_.width()); }
  [[nodiscard]] std::size_t cellCount() const {
    return width() * static_cast<std::size_t>(map_.height());
  }
  [[nodiscard]] Point2 centreOf(std::size_t i) const {
    return transform(
        map_.T_map_grid(),
        {map_.corner().x + (static_cast<double>(i % width()) + 0.5) * map_.resolution(),
         map_.corner().y + (static_cast<double>(i / width()) + 0.5) * map_.resolution()});
  }
  template <class Visit>
  void forNeighbours(std::size_t i, const Visit& visit) const {
    const std::size_t ix = i % width();
    if (ix > 0) visit(i - 1);
    if (ix + 1 < width()) visit(i + 1);
    if (i >= width()) visit(i - width());
    if (i + width() < open_.size()) visit(i + width());
  }
  [[nodiscard]] std::size_t nearestOpen(const Point2& p_map) const {
    const Point2 p = transform(inverse(map_.T_map_grid()), p_map);
    const int cx = static_cast<int>(std::floor((p.x - map_.corner().x) / map_.resolution()));
    const int cy = static_cast<int>(std::floor((p.y - map_.corner().y) / map_.resolution()));
    std::size_t best = cells_.front();
    double best_d2 = std::numeric_limits<double>::max();
    constexpr int kAround = 12;
    for (int iy = std::max(0, cy - kAround); iy <= std::min(map_.height() - 1, cy + kAround);
         ++iy) {
      for (int ix = std::max(0, cx - kAround); ix <= std::min(map_.width() - 1, cx + kAround);
           ++ix) {
        const std::size_t i = static_cast<std::size_t>(iy) * width() + static_cast<std::size_t>(ix);
        const double d2 = (ix - cx) * (ix - cx) + (iy - cy) * (iy - cy);
        if (open_[i] == 0 || d2 >= best_d2) continue;
        best = i;
        best_d2 = d2;
      }
    }
    return best;
  }

  const grid::OccupancyMap& map_;
  std::vector<char> open_;
  std::vector<std::size_t> cells_;  // the open ones
};

/// A robot that goes where it is told, or else from one random place to the next, and never touches
/// anything.
class Wanderer {
 public:
  Wanderer(
      const LostPlace& place,
      const Ground& ground,
      const Pose2& T_map_base,
      const RandomStream& rng)
      : place_(place), ground_(ground), truth_(T_map_base), rng_(rng) {
    range_max_m_ = rng_.uniform(10.0, 12.0);
    outliers_ = rng_.uniform(0.10, 0.15);
    scale_ = rng_.normal(1.0, 0.03);
    yaw_scale_ = rng_.normal(1.0, 0.03);
    yaw_drift_per_m_ = rng_.normal(0.0, degToRad(1.0));
  }

  [[nodiscard]] const Pose2& truth() const { return truth_; }
  [[nodiscard]] double driven() const { return driven_m_; }
  [[nodiscard]] Timestamp time() const { return time_; }
  /// Carried elsewhere without noticing.
  void carryTo(const Pose2& T_map_base) {
    truth_ = T_map_base;
    steps_.clear();
  }

  /// Whether the last tick's goal could not be come nearer to.
  [[nodiscard]] bool blocked() const { return blocked_; }

  /// One tick of driving and what the wheels say of it.
  /// \param goal_base near; empty = wander
  WheelOdometry drive(const std::optional<Point2>& goal_base = {}) {
    blocked_ = false;
    const Pose2 step = goal_base ? stepTowards(*goal_base) : nextStep();
    truth_ = compose(truth_, step);
    driven_m_ += step.x;
    time_ = time_ + durationFromSeconds(kTick_s);
    WheelOdometry odometry;
    odometry.stamp = time_;
    odometry.dt_s = kTick_s;
    odometry.T_previous_now = {
        step.x * (scale_ + rng_.normal(0.0, 0.05)),
        step.x * rng_.normal(0.0, 0.02),
        step.phi * (yaw_scale_ + rng_.normal(0.0, 0.05)) + step.x * yaw_drift_per_m_ +
            step.x * rng_.normal(0.0, degToRad(2.0))};
    return odometry;
  }

  LaserScan scan() {
    LaserScan scan;
    scan.stamp = time_;
    scan.T_base_laser = {0.1, 0.0, 0.0};
    scan.angle_min_rad = -0.75 * kPi;
    scan.angle_step_rad = kRadPerDeg;
    scan.range_min_m = 0.05;
    scan.range_max_m = range_max_m_;
    const Pose2 T_map_laser = compose(truth_, scan.T_base_laser);
    for (int i = 0; i <= 270; ++i) {
      const double yaw = T_map_laser.phi + scan.angle(static_cast<std::size_t>(i));
      double range = place_.ray({T_map_laser.x, T_map_laser.y}, yaw, range_max_m_);
      if (rng_.bernoulli(outliers_)) range = rng_.uniform(0.2, std::max(0.3, range));
      range = range < range_max_m_ ? std::max(0.05, range + rng_.normal(0.0, 0.02))
                                   : std::numeric_limits<double>::infinity();
      scan.ranges_m.push_back(static_cast<float>(range));
    }
    return scan;
  }

 private:
  Pose2 stepTowards(const Point2& goal_base) {
    steps_.clear();
    const auto target = ground_.towards({truth_.x, truth_.y}, transform(truth_, goal_base));
    blocked_ = !target;
    return target ? stepTo(*target) : Pose2{};
  }

  Pose2 nextStep() {
    if (steps_.empty()) steps_ = ground_.stepsTo(ground_.drawCell(rng_));
    const auto target = ground_.ahead(steps_, {truth_.x, truth_.y});
    if (!target) {
      steps_.clear();  // arrived
      return {};
    }
    return stepTo(*target);
  }

  [[nodiscard]] Pose2 stepTo(const Point2& target) const {
    const double bearing =
        angleDiff(std::atan2(target.y - truth_.y, target.x - truth_.x), truth_.phi);
    const double turn = std::clamp(bearing, -kTurn_radps * kTick_s, kTurn_radps * kTick_s);
    const double forward = std::abs(bearing) < degToRad(30.0) ? kSpeed_mps * kTick_s : 0.0;
    return {forward, 0.0, turn};
  }

  const LostPlace& place_;
  const Ground& ground_;
  Pose2 truth_;
  RandomStream rng_;
  double range_max_m_ = 10.0;
  double outliers_ = 0.1;
  double scale_ = 1.0;
  double yaw_scale_ = 1.0;
  double yaw_drift_per_m_ = 0.0;
  double driven_m_ = 0.0;
  std::vector<int> steps_;  // to the present goal
  bool blocked_ = false;
  Timestamp time_;
};

/// Leads a robot that is not sure to where its candidates would see different things. Knows what
/// the robot knows: the map, its candidates and its odometry.
class Guide {
 public:
  explicit Guide(const amcl::TellApart& tell_apart) : tell_apart_(tell_apart) {}

  /// \param places the candidates now, best first
  void look(const std::vector<amcl::Place>& places) {
    constexpr double kSame_m = 0.6;
    constexpr double kSame_rad = degToRad(15.0);
    if (!way_.empty()) {
      const auto mine = std::find_if(places.begin(), places.end(), [&](const amcl::Place& p) {
        const Pose2& T = p.T_map_base.mean;
        return distance(T, T_map_base_) < kSame_m &&
               std::abs(angleDiff(T.phi, T_map_base_.phi)) < kSame_rad;
      });
      if (mine == places.end()) {
        drop(0.0);
      } else {
        T_map_base_ = mine->T_map_base.mean;
      }
    }
    if (wait_m_ > 0.0 || places.empty()) return;
    way_ = tell_apart_.way(places, kAllowed_m);
    wait_m_ = way_.empty() ? kWait_m : kAgain_m;
    next_ = 0;
    T_map_base_ = places.front().T_map_base.mean;
  }

  void moved(const WheelOdometry& odometry) {
    T_map_base_ = compose(T_map_base_, odometry.T_previous_now);
    wait_m_ -= translationNorm(odometry.T_previous_now);
  }

  void giveUp() { drop(kWait_m); }

  /// Where to drive, a little ahead; empty = anywhere.
  [[nodiscard]] std::optional<Point2> goal() {
    constexpr double kAhead_m = 0.5;
    const auto off = [&](std::size_t i) {
      return std::hypot(way_[i].x - T_map_base_.x, way_[i].y - T_map_base_.y);
    };
    while (next_ < way_.size() && off(next_) < kAhead_m) ++next_;
    if (!way_.empty() && next_ >= way_.size()) drop(0.0);
    if (way_.empty()) return std::nullopt;
    return transform(inverse(T_map_base_), way_[next_]);
  }

 private:
  void drop(double wait_m) {
    way_.clear();
    wait_m_ = wait_m;
  }

  static constexpr double kAgain_m = 3.0;  // driven until it looks for the best way again
  static constexpr double kWait_m = 1.5;   // the same where there is none, or it is blocked

  const amcl::TellApart& tell_apart_;
  std::vector<Point2> way_;
  std::size_t next_ = 0;
  Pose2 T_map_base_;  // of the candidate whose way it is
  double wait_m_ = 0.0;
};

/// Where a search began or a robot was put down.
struct Beginning {
  Timestamp time;
  double driven_m = 0.0;
};

void conclude(
    LostTrial& trial,
    const Wanderer& robot,
    const Beginning& beginning,
    const std::optional<Pose2>& claimed) {
  trial.T_map_end = robot.truth();
  trial.driven_m = robot.driven() - beginning.driven_m;
  trial.elapsed_s = toSeconds(robot.time() - beginning.time);
  trial.T_map_claimed = claimed;
  if (!claimed) return;
  trial.error_m = distance(*claimed, robot.truth());
  trial.error_rad = std::abs(angleDiff(claimed->phi, robot.truth().phi));
  trial.outcome = trial.error_m < kRight_m && trial.error_rad < kRight_rad ? LostOutcome::kRight
                                                                           : LostOutcome::kWrong;
}

LostTrial findFrom(
    const LostPlace& place,
    const Ground& ground,
    const amcl::TellApart& tell_apart,
    amcl::GlobalLocalizer& localizer,
    const Pose2& start,
    RandomStream rng) {
  LostTrial trial;
  trial.T_map_start = start;
  Wanderer robot(place, ground, start, rng);
  Guide guide(tell_apart);
  localizer.start();
  std::optional<Pose2> claimed;
  for (int tick = 0; tick < kMaxTicks && robot.driven() < kAllowed_m && !claimed; ++tick) {
    if (tick % kTicksPerScan == 0) {
      const auto began = std::chrono::steady_clock::now();
      localizer.process(robot.scan());
      if (tick == 0) {
        trial.first_search_s =
            std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
      }
      if (localizer.state() == amcl::PlaceState::kSure) {
        claimed = localizer.places().front().T_map_base.mean;
        break;
      }
      guide.look(localizer.places());
    }
    const WheelOdometry odometry = robot.drive(guide.goal());
    if (robot.blocked()) guide.giveUp();
    guide.moved(odometry);
    localizer.process(odometry);
  }
  trial.searches = localizer.searches();
  trial.places = localizer.places();
  trial.state = localizer.state();
  conclude(trial, robot, {}, claimed);
  return trial;
}

LostTrial kidnapFrom(
    const LostPlace& place,
    const amcl::AmclParams& params,
    const Ground& ground,
    const amcl::TellApart& tell_apart,
    std::uint64_t seed,
    RandomStream rng) {
  LostTrial trial;
  const Pose2 start = ground.draw(rng);
  Wanderer robot(place, ground, start, rng);
  amcl::Localizer localizer(params, place.map, seed);
  const Eigen::Matrix3d cov = Eigen::Vector3d(0.02, 0.02, 0.004).asDiagonal();
  localizer.startAt({start, cov});
  Guide guide(tell_apart);
  const auto tick = [&](int n) {
    const WheelOdometry odometry =
        robot.drive(localizer.searching() ? guide.goal() : std::optional<Point2>());
    if (robot.blocked()) guide.giveUp();
    guide.moved(odometry);
    localizer.process(odometry);
    if (n % kTicksPerScan != 0) return;
    localizer.process(robot.scan());
    if (localizer.searching()) guide.look(localizer.places());
  };
  constexpr double kBefore_m = 6.0;
  for (int n = 1; n < kMaxTicks && robot.driven() < kBefore_m; ++n) tick(n);

  constexpr double kElsewhere_m = 5.0;
  Pose2 elsewhere = ground.draw(rng);
  while (distance(elsewhere, robot.truth()) < kElsewhere_m) elsewhere = ground.draw(rng);
  robot.carryTo(elsewhere);
  trial.T_map_start = elsewhere;
  const Beginning beginning{robot.time(), robot.driven()};
  const int searches_before = localizer.searches();
  bool was_searching = localizer.searching();
  int recoveries_before = localizer.recoveries();
  for (int n = 1; n < kMaxTicks && robot.driven() - beginning.driven_m < kAllowed_m; ++n) {
    tick(n);
    const bool claims_again =
        (was_searching || localizer.recoveries() > recoveries_before) && !localizer.searching();
    was_searching = localizer.searching();
    recoveries_before = localizer.recoveries();
    if (!claims_again) continue;
    conclude(trial, robot, beginning, localizer.pose().mean);
    trial.searches = localizer.searches() - searches_before;
    return trial;
  }
  trial.searches = localizer.searches() - searches_before;
  trial.places = localizer.places();
  trial.state = localizer.state();
  conclude(
      trial,
      robot,
      beginning,
      localizer.searching() ? std::nullopt : std::optional<Pose2>(localizer.pose().mean));
  return trial;
}

/// Calls body(i, worker) for all trials side by side.
template <class Body>
void runTrials(std::size_t n, std::size_t workers, const Progress& progress, const Body& body) {
  std::atomic<std::size_t> next{0};
  std::atomic<std::size_t> done{0};
  parallelFor(workers, workers, [&](std::size_t worker) {
    for (std::size_t i = next++; i < n; i = next++) {
      body(i, worker);
      ++done;
      // The first worker is the caller's thread, which may draw.
      if (worker == 0) progress(static_cast<double>(done) / static_cast<double>(n), 0.0);
    }
  });
}

}  // namespace

LostPlace changedMap(const std::string& map_path, std::uint64_t seed) {
  LostPlace place;
  place.name = map_path;
  const auto map = std::make_shared<const grid::OccupancyMap>(io::loadMap(map_path));
  amcl::requireUsable(*map, map_path);
  place.map = map;
  std::vector<grid::Cell> cells;
  for (int iy = 0; iy < map->height(); ++iy) {
    for (int ix = 0; ix < map->width(); ++ix) cells.push_back(map->cell(ix, iy));
  }
  const std::size_t occupied = map->count(grid::Cell::kOccupied);
  constexpr double kChangedShare = 0.05;
  const auto target = static_cast<std::size_t>(kChangedShare * static_cast<double>(occupied));
  RandomStream rng(seed, "changed-map");
  const auto patch = [&](grid::Cell from, grid::Cell to, bool outline) {
    std::size_t changed = 0;
    for (int tries = 0; tries < 1000000 && changed < target; ++tries) {
      const int x0 = static_cast<int>(rng.uniform() * map->width());
      const int y0 = static_cast<int>(rng.uniform() * map->height());
      if (map->cell(x0, y0) != from) continue;
      const int w = static_cast<int>(rng.uniform(0.2, 0.8) / map->resolution());
      const int h = static_cast<int>(rng.uniform(0.2, 0.8) / map->resolution());
      for (int y = y0; y < std::min(y0 + h, map->height()); ++y) {
        for (int x = x0; x < std::min(x0 + w, map->width()); ++x) {
          const bool rim = x == x0 || y == y0 || x == x0 + w - 1 || y == y0 + h - 1;
          if (map->cell(x, y) != from || (outline && !rim)) continue;
          cells[static_cast<std::size_t>(y * map->width() + x)] = to;
          ++changed;
        }
      }
    }
  };
  patch(grid::Cell::kOccupied, grid::Cell::kFree, false);
  patch(grid::Cell::kFree, grid::Cell::kOccupied, true);
  const auto truth = grid::OccupancyMap::fromCells(
      map->width(), map->height(), map->resolution(), map->corner(), cells, map->T_map_grid());
  const auto rays = std::make_shared<const grid::RayCaster>(truth);
  const auto distances = std::make_shared<const grid::DistanceField>(truth);
  place.clearance = [distances](const Point2& p) { return distances->at(p, 0.0); };
  place.inside = [](const Point2&) { return true; };
  place.ray = [rays](const Point2& p, double yaw, double max) { return rays->range(p, yaw, max); };
  return place;
}

LostPlace simulatedWorld(const std::string& world_path) {
  const sim::World world = sim::loadWorld(world_path);
  LostPlace place;
  place.name = world_path;
  place.map =
      std::make_shared<const grid::OccupancyMap>(sim::surveyMap(world, sim::givenMapOf(world)));
  const auto geometry = std::make_shared<const sim::WorldGeometry>(world);
  place.clearance = [geometry](const Point2& p) { return geometry->clearance(p); };
  const bool any_roof = !world.buildings.empty();
  place.inside = [geometry, any_roof](const Point2& p) {
    return !any_roof || geometry->distanceToRoofs(p) < 0.0;
  };
  place.ray = [geometry](const Point2& p, double yaw, double max) {
    return geometry->castRay(p, yaw, max);
  };
  return place;
}

std::vector<LostTrial> benchGlobal(
    const LostPlace& place,
    const Config& config,
    int places,
    std::uint64_t seed,
    const Progress& progress) {
  const Ground ground(place);
  const amcl::TellApart tell_apart(place.map, kRadius_m, config.amcl.global);
  amcl::GlobalParams params = config.amcl.global;
  const std::size_t workers = threadCount(params.search.threads);
  params.search.threads = 1;  // the trials themselves run side by side
  std::vector<LostTrial> trials(static_cast<std::size_t>(places));
  std::vector<std::unique_ptr<amcl::GlobalLocalizer>> localizers;
  for (std::size_t w = 0; w < workers; ++w) {
    localizers.push_back(std::make_unique<amcl::GlobalLocalizer>(params, place.map));
  }
  runTrials(trials.size(), workers, progress, [&](std::size_t i, std::size_t worker) {
    RandomStream rng(seed, "lost-place", i);
    const Pose2 start = ground.draw(rng);
    trials[i] = findFrom(place, ground, tell_apart, *localizers[worker], start, rng);
  });
  return trials;
}

std::vector<LostTrial> benchKidnap(
    const LostPlace& place,
    const Config& config,
    int kidnappings,
    std::uint64_t seed,
    const Progress& progress) {
  const Ground ground(place);
  const amcl::TellApart tell_apart(place.map, kRadius_m, config.amcl.global);
  amcl::AmclParams params = config.amcl;
  const std::size_t workers = threadCount(params.global.search.threads);
  params.global.search.threads = 1;
  std::vector<LostTrial> trials(static_cast<std::size_t>(kidnappings));
  runTrials(trials.size(), workers, progress, [&](std::size_t i, std::size_t) {
    trials[i] =
        kidnapFrom(place, params, ground, tell_apart, seed, RandomStream(seed, "kidnapping", i));
  });
  return trials;
}

}  // namespace vestibule::pipeline
