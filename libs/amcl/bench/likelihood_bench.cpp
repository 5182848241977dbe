// Weighing a scan: our likelihood table against MRPT's own likelihood field, which it replaces
// under MRPT's particle filter. Same map, same poses, same beams; items are particle-beams.

#include <benchmark/benchmark.h>
#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/poses/CPose2D.h>

#include <cmath>

#include "../src/likelihood_table.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::amcl {
namespace {

constexpr int kWidth = 1000;
constexpr int kHeight = 600;
constexpr double kResolution = 0.05;
constexpr int kParticles = 2000;

/// A hall of 50 x 30 m with a grid of pillars.
const grid::OccupancyMap& hall() {
  static const grid::OccupancyMap map = [] {
    std::vector<grid::Cell> cells(kWidth * kHeight, grid::Cell::kFree);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool wall = x < 2 || y < 2 || x >= kWidth - 2 || y >= kHeight - 2;
        const bool pillar = x % 120 > 112 && y % 100 > 92;
        if (wall || pillar) cells[static_cast<std::size_t>(y * kWidth + x)] = grid::Cell::kOccupied;
      }
    }
    return grid::OccupancyMap::fromCells(kWidth, kHeight, kResolution, {0.0, 0.0}, cells);
  }();
  return map;
}

/// What a lidar with 270 degrees sees from the middle of the hall.
mrpt::obs::CObservation2DRangeScan scanOf(std::size_t beams) {
  mrpt::obs::CObservation2DRangeScan scan;
  scan.aperture = static_cast<float>(1.5 * kPi);
  scan.rightToLeft = true;
  scan.maxRange = 40.0F;
  hall().mrptGrid()->laserScanSimulator(scan, mrpt::poses::CPose2D(25.3, 14.8, 0.2), 0.5F, beams);
  return scan;
}

std::vector<Pose2> particles() {
  RandomStream rng(1, "bench");
  std::vector<Pose2> poses(kParticles);
  for (Pose2& p : poses) {
    p = {rng.normal(25.3, 0.5), rng.normal(14.8, 0.5), rng.normal(0.2, 0.3)};
  }
  return poses;
}

void setItems(benchmark::State& state) {
  state.SetItemsProcessed(state.iterations() * kParticles * state.range(0));
}

void ourTable(benchmark::State& state) {
  const auto beams = static_cast<std::size_t>(state.range(0));
  const auto scan = scanOf(beams);
  BeamEnds ends;
  for (std::size_t i = 0; i < beams; ++i) {
    const double angle =
        -0.75 * kPi + 1.5 * kPi * static_cast<double>(i) / static_cast<double>(beams - 1);
    const auto range = static_cast<double>(scan.getScanRange(i));
    ends.x.push_back(static_cast<float>(range * std::cos(angle)));
    ends.y.push_back(static_cast<float>(range * std::sin(angle)));
  }
  const grid::DistanceField field(hall());
  const LikelihoodTable table(hall(), field, {});
  const auto poses = particles();
  for (auto _ : state) {
    for (const Pose2& p : poses) benchmark::DoNotOptimize(table.logLikelihood(p, ends));
  }
  setItems(state);
}
BENCHMARK(ourTable)->Arg(60)->Arg(180);

void mrptLikelihoodField(benchmark::State& state) {
  const auto scan = scanOf(static_cast<std::size_t>(state.range(0)));
  mrpt::maps::COccupancyGridMap2D grid(*hall().mrptGrid());
  grid.likelihoodOptions.likelihoodMethod =
      mrpt::maps::COccupancyGridMap2D::lmLikelihoodField_Thrun;
  grid.likelihoodOptions.LF_decimation = 1;
  grid.likelihoodOptions.LF_maxCorrsDistance = 0.7F;
  const auto poses = particles();
  // Warm: its cache of cells is filled before the clock starts.
  for (const Pose2& p : poses) {
    (void)grid.computeObservationLikelihood(
        scan, mrpt::poses::CPose3D(mrpt::poses::CPose2D(p.x, p.y, p.phi)));
  }
  for (auto _ : state) {
    for (const Pose2& p : poses) {
      benchmark::DoNotOptimize(grid.computeObservationLikelihood(
          scan, mrpt::poses::CPose3D(mrpt::poses::CPose2D(p.x, p.y, p.phi))));
    }
  }
  setItems(state);
}
BENCHMARK(mrptLikelihoodField)->Arg(60)->Arg(180);

}  // namespace
}  // namespace vestibule::amcl

BENCHMARK_MAIN();
