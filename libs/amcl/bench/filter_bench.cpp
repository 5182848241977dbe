// The particle filter against MRPT's, which it replaces: same map, scans, motion and number of
// particles, in one run. Real data: the localization demo of MRPT (its map at 6 cm).

#include <benchmark/benchmark.h>
#include <mrpt/bayes/CParticleFilter.h>
#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CRawlog.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/random/RandomGenerators.h>
#include <mrpt/serialization/CArchive.h>
#include <mrpt/slam/CMonteCarloLocalization2D.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "../src/motion_model.hpp"
#include "../src/particle_set.hpp"
#include "vestibule/amcl/particle_localizer.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::amcl {
namespace {

const std::string kData = "/usr/share/mrpt/datasets/";
constexpr double kResolution = 0.06;
const Pose2 kEnd{15.89, -10.0, 0.084};  // where the recording ends

struct Demo {
  mrpt::maps::COccupancyGridMap2D::Ptr grid = mrpt::maps::COccupancyGridMap2D::Create(
      -1.0F, 1.0F, -1.0F, 1.0F, static_cast<float>(kResolution));
  std::shared_ptr<const grid::OccupancyMap> map;
  mrpt::obs::CObservation2DRangeScan scan;  ///< the last one

  Demo() {
    mrpt::maps::CSimpleMap frames;
    mrpt::io::CFileGZInputStream map_file(kData + "localization_demo.simplemap.gz");
    mrpt::serialization::archiveFrom(map_file) >> frames;
    grid->loadFromSimpleMap(frames);
    map = std::make_shared<const grid::OccupancyMap>(grid, Pose2{});
    mrpt::obs::CRawlog log;
    log.loadFromRawLogFile(kData + "localization_demo.rawlog");
    for (std::size_t i = 0; i < log.size(); ++i) {
      if (log.getType(i) != mrpt::obs::CRawlog::etSensoryFrame) continue;
      const auto found =
          log.getAsObservations(i)->getObservationByClass<mrpt::obs::CObservation2DRangeScan>();
      if (found) scan = *found;
    }
  }
};
const Demo& demo() {
  static const Demo data;
  return data;
}

/// The last scan with that many beams left, evenly.
mrpt::obs::CObservation2DRangeScan thinned(std::size_t beams) {
  mrpt::obs::CObservation2DRangeScan scan = demo().scan;
  const std::size_t all = scan.getScanSize();
  mrpt::obs::CObservation2DRangeScan few = scan;
  few.resizeScan(beams);
  for (std::size_t k = 0; k < beams; ++k) {
    // A beam without echo takes that of its neighbour: all beams of the bench count.
    std::size_t i = k * (all - 1) / (beams - 1);
    while (i > 0 && !scan.getScanRangeValidity(i)) --i;
    few.setScanRange(k, scan.getScanRange(i));
    few.setScanRangeValidity(k, true);
  }
  return few;
}

std::vector<Point2> endsOf(const mrpt::obs::CObservation2DRangeScan& scan) {
  std::vector<Point2> ends;
  const std::size_t n = scan.getScanSize();
  for (std::size_t i = 0; i < n; ++i) {
    const double aperture = static_cast<double>(scan.aperture);
    const double angle = aperture * (static_cast<double>(i) / static_cast<double>(n - 1) - 0.5);
    const auto range = static_cast<double>(scan.getScanRange(i));
    ends.push_back({scan.sensorPose.x() + range * std::cos(angle), range * std::sin(angle)});
  }
  return ends;
}

// A step of 5 cm and 1 degree there, and back at the next update, so that the cloud stays.
Pose2 stepOf(int update) {
  return update % 2 == 0 ? Pose2{0.05, 0.0, 0.0175} : inverse(Pose2{0.05, 0.0, 0.0175});
}

void setItems(benchmark::State& state) {
  // Seconds per particle-beam, printed with a unit prefix.
  state.counters["per_particle_beam"] = benchmark::Counter(
      static_cast<double>(state.iterations() * state.range(0) * state.range(1)),
      benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

/// Predict, weigh, resample, mean and covariance.
void ourUpdate(benchmark::State& state, Simd simd) {
  const auto n = static_cast<std::size_t>(state.range(0));
  const auto ends = endsOf(thinned(static_cast<std::size_t>(state.range(1))));
  const grid::DistanceField field(*demo().map);
  const LikelihoodTable table(*demo().map, field, {});
  ParticleSet particles(table, 1, simd);
  particles.resize(n);
  RandomStream rng(1, "bench");
  for (std::size_t i = 0; i < n; ++i) {
    particles.set(
        i, {rng.normal(kEnd.x, 0.1), rng.normal(kEnd.y, 0.1), rng.normal(kEnd.phi, 0.05)});
  }
  mrpt::bayes::CParticleFilter driver;
  driver.m_options.adaptiveSampleSize = true;
  driver.m_options.powFactor = 18.0 / static_cast<double>(ends.size());
  int update = 0;
  for (auto _ : state) {
    const Pose2 step = stepOf(update);
    ParticleStep what;
    what.increment = noisyIncrement(likelyMotion({step, 0.05, 0.0175, 0.0}, {}));
    what.noise.seed = {1, 2};
    what.noise.step = static_cast<std::uint64_t>(update++);
    what.ends = &ends;
    particles.prepare(what);
    driver.executeOn(particles, nullptr, nullptr);
    benchmark::DoNotOptimize(particles.moments());
    particles.resample(n, rng.uniform());
  }
  setItems(state);
}
BENCHMARK_CAPTURE(ourUpdate, portable, Simd::kPortable)
    ->Args({2000, 60})
    ->Args({2000, 180})
    ->Args({20000, 60});
BENCHMARK_CAPTURE(ourUpdate, best, bestSimd())
    ->Args({2000, 60})
    ->Args({2000, 180})
    ->Args({20000, 60});

/// Weighing alone.
void ourSensorStep(benchmark::State& state, Simd simd) {
  const auto n = static_cast<std::size_t>(state.range(0));
  const auto ends = endsOf(thinned(static_cast<std::size_t>(state.range(1))));
  const grid::DistanceField field(*demo().map);
  const LikelihoodTable table(*demo().map, field, {});
  ParticleSet particles(table, 1, simd);
  particles.resize(n);
  RandomStream rng(1, "bench");
  for (std::size_t i = 0; i < n; ++i) {
    particles.set(
        i, {rng.normal(kEnd.x, 0.1), rng.normal(kEnd.y, 0.1), rng.normal(kEnd.phi, 0.05)});
  }
  for (auto _ : state) benchmark::DoNotOptimize(particles.logLikelihoods(ends));
  setItems(state);
}
BENCHMARK_CAPTURE(ourSensorStep, portable, Simd::kPortable)
    ->Args({2000, 60})
    ->Args({2000, 180})
    ->Args({20000, 60});
BENCHMARK_CAPTURE(ourSensorStep, best, bestSimd())
    ->Args({2000, 60})
    ->Args({2000, 180})
    ->Args({20000, 60});

void mrptUpdate(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0));
  auto grid = mrpt::maps::COccupancyGridMap2D::Create(*demo().grid);
  grid->likelihoodOptions.likelihoodMethod =
      mrpt::maps::COccupancyGridMap2D::lmLikelihoodField_Thrun;
  grid->likelihoodOptions.LF_decimation = 1;
  grid->likelihoodOptions.LF_maxCorrsDistance = 0.7F;
  grid->likelihoodOptions.enableLikelihoodCache = true;
  mrpt::random::getRandomGenerator().randomize(1);
  mrpt::slam::CMonteCarloLocalization2D filter;
  filter.options.metricMap = grid;
  filter.resetDeterministic(mrpt::math::TPose2D(kEnd.x, kEnd.y, kEnd.phi), n);
  RandomStream rng(1, "bench");
  for (auto& p : filter.m_particles) {
    p.d = {rng.normal(kEnd.x, 0.1), rng.normal(kEnd.y, 0.1), rng.normal(kEnd.phi, 0.05)};
  }
  mrpt::bayes::CParticleFilter driver;
  driver.m_options.PF_algorithm = mrpt::bayes::CParticleFilter::pfStandardProposal;
  driver.m_options.resamplingMethod = mrpt::bayes::CParticleFilter::prSystematic;
  driver.m_options.adaptiveSampleSize = false;
  driver.m_options.BETA = 1.1;  // resample at every update
  driver.m_options.powFactor = 18.0 / static_cast<double>(state.range(1));
  // All beams shall count: MRPT drops the points of thinned scans that lie far from each other.
  mrpt::obs::CSensoryFrame frame;
  frame.insert(mrpt::obs::CObservation2DRangeScan::Create(
      thinned(static_cast<std::size_t>(state.range(1)))));
  int update = 0;
  const auto step = [&] {
    const Pose2 T = stepOf(update++);
    mrpt::obs::CActionRobotMovement2D::TMotionModelOptions model;
    model.modelSelection = mrpt::obs::CActionRobotMovement2D::mmGaussian;
    mrpt::obs::CActionRobotMovement2D movement;
    movement.computeFromOdometry(mrpt::poses::CPose2D(T.x, T.y, T.phi), model);
    mrpt::obs::CActionCollection actions;
    actions.insert(movement);
    driver.executeOn(filter, &actions, &frame);
    benchmark::DoNotOptimize(filter.getCovarianceAndMean());
  };
  for (int i = 0; i < 5; ++i) step();  // fills its cache of cells before the clock starts
  for (auto _ : state) step();
  setItems(state);
}
BENCHMARK(mrptUpdate)->Args({2000, 60})->Args({2000, 180})->Args({20000, 60});

/// The localizer as it tracks: KLD sample size, beam choice, refinement, trust. Of the times of the
/// scans also the median and what one in a hundred exceeds.
void tracking(benchmark::State& state) {
  ParticleLocalizer localizer({}, demo().map, 1);
  localizer.initialise({kEnd, Eigen::Vector3d(0.01, 0.01, 0.001).asDiagonal()});
  LaserScan scan;
  const auto& from = demo().scan;
  scan.angle_min_rad = -0.5 * static_cast<double>(from.aperture);
  scan.angle_step_rad =
      static_cast<double>(from.aperture) / static_cast<double>(from.getScanSize() - 1);
  scan.range_max_m = static_cast<double>(from.maxRange);
  scan.T_base_laser = {from.sensorPose.x(), from.sensorPose.y(), from.sensorPose.yaw()};
  for (std::size_t i = 0; i < from.getScanSize(); ++i) {
    scan.ranges_m.push_back(from.getScanRange(i));
  }
  double t_s = 0.0;
  int update = 0;
  std::vector<double> times_ms;
  for (auto _ : state) {
    const auto before = std::chrono::steady_clock::now();
    WheelOdometry odometry;
    t_s += 1.1;
    odometry.stamp = scan.stamp = timestampFromSeconds(t_s);
    odometry.T_previous_now = stepOf(update++);
    localizer.process(odometry);
    benchmark::DoNotOptimize(localizer.process(scan));
    times_ms.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - before)
            .count());
  }
  std::sort(times_ms.begin(), times_ms.end());
  state.counters["median_ms"] = times_ms[times_ms.size() / 2];
  state.counters["p99_ms"] = times_ms[times_ms.size() * 99 / 100];
  state.counters["particles"] = static_cast<double>(localizer.lastReport().particles);
}
BENCHMARK(tracking);

/// A building of 2000 x 2000 cells, or however many: rooms of 6 x 8 m with doors.
grid::OccupancyMap rooms(int side) {
  std::vector<grid::Cell> cells(static_cast<std::size_t>(side * side), grid::Cell::kFree);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const bool wall = (x % 120 < 2 && y % 97 > 15) || (y % 160 < 2 && x % 83 > 15);
      if (wall) cells[static_cast<std::size_t>(y * side + x)] = grid::Cell::kOccupied;
    }
  }
  return grid::OccupancyMap::fromCells(side, side, 0.05, {0, 0}, cells);
}

void distanceField(benchmark::State& state) {
  const auto map = rooms(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    const grid::DistanceField field(map);
    benchmark::DoNotOptimize(field.cells().data());
  }
}
BENCHMARK(distanceField)->Arg(2000)->Unit(benchmark::kMillisecond);

/// A box of 10 x 10 cells that comes and goes.
void distanceFieldUpdate(benchmark::State& state) {
  const auto map = rooms(static_cast<int>(state.range(0)));
  const auto grid = mrpt::maps::COccupancyGridMap2D::Create(*map.mrptGrid());
  const grid::OccupancyMap changing(grid, Pose2{});
  grid::DistanceField field(changing);
  bool there = false;
  for (auto _ : state) {
    there = !there;
    for (int y = 1000; y < 1010; ++y) {
      for (int x = 1000; x < 1010; ++x) grid->setCell(x, y, there ? 0.02F : 0.98F);
    }
    field.update(changing, {1000, 1000, 1009, 1009});
  }
}
BENCHMARK(distanceFieldUpdate)->Arg(2000)->Unit(benchmark::kMillisecond);

void likelihoodTable(benchmark::State& state) {
  const auto map = rooms(static_cast<int>(state.range(0)));
  const grid::DistanceField field(map);
  for (auto _ : state) benchmark::DoNotOptimize(LikelihoodTable(map, field, {}).view().values);
}
BENCHMARK(likelihoodTable)->Arg(2000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace vestibule::amcl

BENCHMARK_MAIN();
