// One update of the particle filter, per particle, and its parts, beside what MRPT offers for the
// same work: ICP of two scans for the match, the copy of a whole grid for resampling. 180 beams in
// a hall of 20 x 16 m.

#include <benchmark/benchmark.h>
#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/slam/CICP.h>

#include <cmath>

#include "../src/scan_integrator.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/mapping/drive_path.hpp"
#include "vestibule/mapping/rbpf.hpp"
#include "vestibule/mapping/scan_matcher.hpp"

namespace vestibule::mapping {
namespace {

constexpr std::size_t kBeams = 180;

/// Range to the walls of the hall and of a 4 x 3 m block in it.
double rangeAt(const Pose2& from, double angle) {
  const double dx = std::cos(angle);
  const double dy = std::sin(angle);
  const double rx = ((dx > 0.0 ? 20.0 : 0.0) - from.x) / dx;
  const double ry = ((dy > 0.0 ? 16.0 : 0.0) - from.y) / dy;
  double range = std::min(rx, ry);
  // Slabs of the block.
  const double x1 = (8.0 - from.x) / dx;
  const double x2 = (12.0 - from.x) / dx;
  const double y1 = (6.5 - from.y) / dy;
  const double y2 = (9.5 - from.y) / dy;
  const double in = std::max(std::min(x1, x2), std::min(y1, y2));
  const double out = std::min(std::max(x1, x2), std::max(y1, y2));
  if (in > 0.0 && in < out) range = std::min(range, in);
  return range;
}

LaserScan scanFrom(const Pose2& T_map_base, RandomStream& noise) {
  LaserScan scan;
  scan.angle_min_rad = -kPi / 2.0;
  scan.angle_step_rad = kPi / 180.0;
  scan.range_max_m = 80.0;
  for (std::size_t i = 0; i < kBeams; ++i) {
    const double range = rangeAt(T_map_base, T_map_base.phi + scan.angle(i));
    scan.ranges_m.push_back(static_cast<float>(range + noise.normal(0.0, 0.01)));
  }
  return scan;
}

/// A drive around the block with odometry that is 3 % wrong.
struct HallDrive {
  std::vector<ScanNode> nodes;
  explicit HallDrive(double step_m) {
    RandomStream noise(1, "hall");
    const int count = static_cast<int>(32.0 / step_m);
    for (int i = 0; i < count; ++i) {
      const double t = 2.0 * kPi * i / count;
      ScanNode node;
      node.T_map_base = {
          10.0 + 6.0 * std::cos(t),
          8.0 + 4.0 * std::sin(t),
          std::atan2(4.0 * std::cos(t), -6.0 * std::sin(t))};
      if (i > 0) {
        const Pose2 step = between(nodes.back().T_map_base, node.T_map_base);
        node.T_odom_base =
            compose(nodes.back().T_odom_base, {1.03 * step.x, 1.03 * step.y, 1.03 * step.phi});
      }
      node.scan = scanFrom(node.T_map_base, noise);
      nodes.push_back(node);
    }
  }
};

/// Whole updates; items are particle-updates. Argument: particles, centimetres between updates.
void BM_Update(benchmark::State& state) {
  const HallDrive drive(static_cast<double>(state.range(1)) / 100.0);
  FilterParams params;
  params.particles = static_cast<int>(state.range(0));
  params.threads = 1;
  params.update_d_m = 0.9 * static_cast<double>(state.range(1)) / 100.0;
  std::size_t used = 0;
  for (auto _ : state) {
    Rbpf filter(params, 1);
    for (const ScanNode& node : drive.nodes) {
      used += filter.process(node.scan, node.T_odom_base).used ? 1U : 0U;
    }
    benchmark::DoNotOptimize(filter.pose());
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(used) * state.range(0));
}
BENCHMARK(BM_Update)->Args({15, 20})->Args({30, 20})->Args({30, 100})->Unit(
    benchmark::kMillisecond);

void BM_Search(benchmark::State& state) {
  const HallDrive drive(0.2);
  const PatchMap map = mapOf(drive.nodes, {});
  ScanMatcher matcher({});
  const ScanPoints points = matchPoints(drive.nodes[10].scan, {});
  const PosePrior prior{drive.nodes[10].T_map_base, Eigen::Matrix3d::Identity()};
  const double window_m = static_cast<double>(state.range(0)) / 100.0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(matcher.search(map, points, prior, window_m, degToRad(15.0)));
  }
}
BENCHMARK(BM_Search)->Arg(15)->Arg(30)->Arg(120)->Unit(benchmark::kMicrosecond);

void BM_Refine(benchmark::State& state) {
  const HallDrive drive(0.2);
  const PatchMap map = mapOf(drive.nodes, {});
  const ScanMatcher matcher({});
  const ScanPoints points = matchPoints(drive.nodes[10].scan, {});
  const PosePrior prior{drive.nodes[10].T_map_base, Eigen::Matrix3d::Identity()};
  const Pose2 start = compose(drive.nodes[10].T_map_base, {0.02, -0.02, degToRad(0.5)});
  for (auto _ : state) benchmark::DoNotOptimize(matcher.refine(map, points, start, prior));
}
BENCHMARK(BM_Refine)->Unit(benchmark::kMicrosecond);

mrpt::obs::CObservation2DRangeScan toMrpt(const LaserScan& scan) {
  mrpt::obs::CObservation2DRangeScan obs;
  obs.aperture = static_cast<float>(kPi);
  obs.rightToLeft = true;
  obs.maxRange = 80.0F;
  obs.resizeScanAndAssign(scan.ranges_m.size(), 0.0F, true);
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) obs.setScanRange(i, scan.ranges_m[i]);
  return obs;
}

/// What MRPT has for the match of a scan.
void BM_MrptIcp(benchmark::State& state) {
  const HallDrive drive(0.2);
  mrpt::maps::CSimplePointsMap map;
  for (std::size_t i = 5; i < 10; ++i) {
    const mrpt::poses::CPose3D pose(toPose3(drive.nodes[i].T_map_base));
    map.insertObservation(toMrpt(drive.nodes[i].scan), pose);
  }
  mrpt::maps::CSimplePointsMap scan;
  scan.insertObservation(toMrpt(drive.nodes[10].scan));
  mrpt::slam::CICP icp;
  icp.options.maxIterations = 40;
  const Pose2 start = compose(drive.nodes[10].T_map_base, {0.02, -0.02, degToRad(0.5)});
  for (auto _ : state) {
    mrpt::slam::CICP::TReturnInfo info;
    benchmark::DoNotOptimize(icp.Align(&map, &scan, mrpt::poses::CPose2D(start), info));
  }
}
BENCHMARK(BM_MrptIcp)->Unit(benchmark::kMicrosecond);

void BM_Integrate(benchmark::State& state) {
  const HallDrive drive(0.2);
  PatchMap map = mapOf(drive.nodes, {});
  ScanIntegrator integrator({});
  std::size_t i = 0;
  for (auto _ : state) {
    const ScanNode& node = drive.nodes[i++ % drive.nodes.size()];
    integrator.integrate(map, node.scan, node.T_map_base);
  }
}
BENCHMARK(BM_Integrate)->Unit(benchmark::kMicrosecond);

void BM_CopyMap(benchmark::State& state) {
  const PatchMap map = mapOf(HallDrive(0.2).nodes, {});
  for (auto _ : state) {
    PatchMap copy = map;
    benchmark::DoNotOptimize(copy);
  }
}
BENCHMARK(BM_CopyMap)->Unit(benchmark::kMicrosecond);

void BM_MrptCopyMap(benchmark::State& state) {
  const mrpt::maps::COccupancyGridMap2D map(-2.0F, 22.0F, -2.0F, 18.0F, 0.05F);
  for (auto _ : state) {
    mrpt::maps::COccupancyGridMap2D copy = map;
    benchmark::DoNotOptimize(copy.getRawMap().data());
  }
}
BENCHMARK(BM_MrptCopyMap)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace vestibule::mapping

BENCHMARK_MAIN();
