#include "vestibule/pipeline/place_bench.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>

#include "trials.hpp"
#include "vestibule/amcl/localizer.hpp"
#include "vestibule/amcl/tell_apart.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/parallel.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/grid/distance_field.hpp"
#include "vestibule/grid/ray_caster.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/sim/given_map.hpp"
#include "vestibule/sim/lidar.hpp"
#include "vestibule/sim/world.hpp"
#include "vestibule/sim/world_geometry.hpp"
#include "wanderer.hpp"

namespace vestibule::pipeline {
namespace {

constexpr double kAllowed_m = 20.0;
constexpr double kRight_m = 0.3;
constexpr double kRight_rad = degToRad(5.0);
constexpr double kLidarHeight_m = 0.4;
constexpr int kMaxTicks = 3000;
constexpr int kTicksPerScan = 2;

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

}  // namespace

LostPlace changedMap(const std::string& map_path, std::uint64_t seed) {
  LostPlace place;
  place.name = std::filesystem::path(map_path).stem().string();
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

std::vector<LostPlace> simulatedWorld(const std::string& world_path) {
  const sim::World world = sim::loadWorld(world_path);
  const auto geometry = std::make_shared<const sim::WorldGeometry>(world);
  const bool any_roof = !world.buildings.empty();
  const std::string name = std::filesystem::path(world_path).stem().string();
  if (world.given_maps.empty()) {
    throw ConfigError(world_path + ": this world has no given map to be lost in");
  }
  std::vector<LostPlace> places;
  for (const sim::GivenMap& given : world.given_maps) {
    LostPlace place;
    place.name = world.given_maps.size() > 1 ? name + " " + given.name : name;
    place.map = std::make_shared<const grid::OccupancyMap>(sim::surveyMap(world, given));
    place.clearance = [geometry](const Point2& p) { return geometry->clearance(p); };
    place.inside = [geometry, any_roof](const Point2& p) {
      return !any_roof || geometry->distanceToRoofs(p) < 0.0;
    };
    place.ray = [geometry](const Point2& p, double yaw, double max) {
      const Eigen::Vector3d origin(p.x, p.y, geometry->groundHeight(p) + kLidarHeight_m);
      const Eigen::Vector3d direction(std::cos(yaw), std::sin(yaw), 0.0);
      const sim::Moment nothing_moves;
      sim::RayHit hit = geometry->castRay(nothing_moves, origin, direction, max);
      if (hit.hit && hit.material == sim::Material::kGlass) {
        hit = sim::throughGlass(*geometry, nothing_moves, origin, direction, hit, max);
      }
      return hit.range_m;
    };
    places.push_back(std::move(place));
  }
  return places;
}

std::vector<LostPlace> lostPlaces(
    const std::vector<std::string>& map_paths,
    const std::vector<std::string>& world_paths,
    std::uint64_t seed) {
  std::vector<LostPlace> places;
  for (const std::string& path : map_paths) places.push_back(changedMap(path, seed));
  for (const std::string& path : world_paths) {
    for (LostPlace& place : simulatedWorld(path)) places.push_back(std::move(place));
  }
  std::map<std::string, int> seen;
  for (LostPlace& place : places) {
    const int before = seen[place.name]++;
    if (before > 0) place.name += " " + std::to_string(before + 1);
  }
  return places;
}

std::vector<LostTrial> benchGlobal(
    const LostPlace& place,
    const Config& config,
    int places,
    std::uint64_t seed,
    const Progress& progress) {
  const Ground ground(place);
  const amcl::TellApart tell_apart(place.map, kWandererRadius_m, config.amcl.global);
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
  const amcl::TellApart tell_apart(place.map, kWandererRadius_m, config.amcl.global);
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
