// Finding a pose in a whole building and in a small window.

#include <benchmark/benchmark.h>

#include <cmath>

#include "vestibule/core/random.hpp"
#include "vestibule/grid/branch_and_bound.hpp"
#include "vestibule/grid/correlative.hpp"
#include "vestibule/grid/ray_caster.hpp"

namespace vestibule::grid {
namespace {

constexpr double kResolution = 0.05;
constexpr int kWidth = 2000;
constexpr int kHeight = 1200;
constexpr double kReach_m = 12.0;

/// A building of 100 x 60 m: rooms of random size along corridors, with doors and furniture.
const OccupancyMap& building() {
  static const OccupancyMap map = [] {
    RandomStream rng(7, "building");
    std::vector<Cell> cells(static_cast<std::size_t>(kWidth) * kHeight, Cell::kFree);
    const auto fill = [&](int x0, int x1, int y0, int y1, Cell kind) {
      for (int y = std::max(0, y0); y < std::min(kHeight, y1); ++y) {
        for (int x = std::max(0, x0); x < std::min(kWidth, x1); ++x) {
          cells[static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x)] = kind;
        }
      }
    };
    for (int row = 0; row <= kHeight; row += 170) {
      fill(0, kWidth, row, row + 3, Cell::kOccupied);
      fill(0, kWidth, row + 126, row + 129, Cell::kOccupied);  // a corridor of 2 m beside it
      for (int x = 0; x < kWidth;) {
        const int width = static_cast<int>(rng.uniform(60, 160));
        fill(x, x + 3, row, row + 126, Cell::kOccupied);
        const int door = x + static_cast<int>(rng.uniform(10, width - 25));
        fill(door, door + 20, row + 126, row + 129, Cell::kFree);
        for (int item = 0; item < 4; ++item) {
          const int ix = x + static_cast<int>(rng.uniform(5, width - 15));
          const int iy = row + static_cast<int>(rng.uniform(5, 110));
          fill(
              ix,
              ix + static_cast<int>(rng.uniform(4, 25)),
              iy,
              iy + static_cast<int>(rng.uniform(4, 25)),
              Cell::kOccupied);
        }
        x += width;
      }
    }
    fill(kWidth - 3, kWidth, 0, kHeight, Cell::kOccupied);
    return OccupancyMap::fromCells(kWidth, kHeight, kResolution, {0, 0}, cells);
  }();
  return map;
}

/// End points of 80 beams over 270 degrees from a free place, 15 % of them hitting something else.
std::vector<Point2> scanFrom(const RayCaster& caster, std::uint64_t place) {
  RandomStream rng(place, "scan");
  Pose2 T;
  do {
    T = {rng.uniform(1.0, 99.0), rng.uniform(1.0, 59.0), rng.uniform(-kPi, kPi)};
  } while (building().at({T.x, T.y}) != Cell::kFree);
  std::vector<Point2> points;
  for (int i = 0; i < 80; ++i) {
    const double bearing = -0.75 * kPi + 1.5 * kPi * i / 79.0;
    double range = caster.range({T.x, T.y}, T.phi + bearing, kReach_m);
    if (range >= kReach_m) continue;
    if (rng.bernoulli(0.15)) range = rng.uniform(0.2, range);
    range += rng.normal(0.0, 0.02);
    points.push_back({range * std::cos(bearing), range * std::sin(bearing)});
  }
  return points;
}

void buildScoreField(benchmark::State& state) {
  const DistanceField distances(building());
  for (auto _ : state) {
    benchmark::DoNotOptimize(ScoreField::fromDistances(building(), distances, 0.15, 0.1, kReach_m));
  }
}
BENCHMARK(buildScoreField)->Unit(benchmark::kMillisecond);

void searchWholeBuilding(benchmark::State& state) {
  const auto field =
      ScoreField::fromDistances(building(), DistanceField(building()), 0.15, 0.1, kReach_m);
  const BaseMask mask = BaseMask::freeSpace(field, building());
  const RayCaster caster(building());
  BranchAndBoundParams params;
  params.threads = static_cast<int>(state.range(0));
  const BranchAndBoundMatcher matcher(params);
  std::uint64_t place = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const auto points = scanFrom(caster, place++ % 20);
    state.ResumeTiming();
    benchmark::DoNotOptimize(matcher.match(field, points, wholeField(field), &mask));
  }
}
BENCHMARK(searchWholeBuilding)
    ->Arg(1)
    ->Arg(2)
    ->Iterations(20)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void searchSmallWindow(benchmark::State& state) {
  const auto field =
      ScoreField::fromDistances(building(), DistanceField(building()), 0.1, kResolution, kReach_m);
  const RayCaster caster(building());
  const auto points = scanFrom(caster, 1);
  const SearchWindow everywhere = wholeField(field);
  const auto best = BranchAndBoundMatcher({}).match(field, points, everywhere);
  const Pose2 guess = compose(best.at(0).T_map_base, Pose2{0.1, -0.1, degToRad(5.0)});
  const CorrelativeMatcher matcher({});
  for (auto _ : state) benchmark::DoNotOptimize(matcher.match(field, points, guess));
}
BENCHMARK(searchSmallWindow)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace vestibule::grid

BENCHMARK_MAIN();
