// Cost of the simulator on one core: each sensor alone and the whole robot on the campus. The
// whole must run at least 50 times faster than real time (20 ms per simulated second).

#include <benchmark/benchmark.h>

#include "vestibule/sim/simulator.hpp"

namespace vestibule::sim {
namespace {

const World& campus() {
  static const World world =
      loadWorld(std::string(VESTIBULE_SOURCE_DIR) + "/config/worlds/campus.yaml");
  return world;
}

void robotOnCampus(benchmark::State& state) {
  Simulator simulator(campus(), SimParams{}, {-8.0, 7.0, 0.0}, 1);
  for (auto _ : state) {
    simulator.command(0.3, 0.5);
    benchmark::DoNotOptimize(simulator.step(std::chrono::seconds(1)));
  }
  state.counters["x_real_time"] =
      benchmark::Counter(static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(robotOnCampus)->Unit(benchmark::kMillisecond);

void scan(benchmark::State& state) {
  const WorldGeometry geometry(campus());
  const Moment moment = geometry.momentAt(3.0);
  const LidarParams params;
  std::uint64_t index = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(simulateScan(
        geometry,
        moment,
        params,
        [](double) {
          return Pose3{-8, 7, 0, 0, 0, 0};
        },
        {},
        {},
        1,
        index++));
  }
}
BENCHMARK(scan)->Unit(benchmark::kMicrosecond);

void fix(benchmark::State& state) {
  const WorldGeometry geometry(campus());
  const Moment moment = geometry.momentAt(3.0);
  GnssModel gnss(geometry, campus().datum, {}, 1);
  Timestamp stamp = kStartOfTime;
  for (auto _ : state) {
    stamp = stamp + std::chrono::milliseconds(200);
    benchmark::DoNotOptimize(gnss.measure(stamp, moment, {-8, 7, 1}));
  }
}
BENCHMARK(fix)->Unit(benchmark::kMicrosecond);

void inertial(benchmark::State& state) {
  ImuModel imu({}, 1);
  for (auto _ : state) {
    benchmark::DoNotOptimize(imu.measure({}, {0, 0, 0.3}, {0, 0, 9.8}, 0.5));
  }
}
BENCHMARK(inertial);

void ringSweep(benchmark::State& state) {
  const WorldGeometry geometry(campus());
  const Moment moment = geometry.momentAt(3.0);
  std::uint64_t index = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(simulateSweep(
        geometry,
        moment,
        {},
        [](double) {
          return Pose3{-8, 7, 0, 0, 0, 0};
        },
        {},
        1,
        index++));
  }
}
BENCHMARK(ringSweep)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace vestibule::sim

BENCHMARK_MAIN();
