// What finishing a map costs: one comparison of two scans, and the pose graph beside the two
// optimisers that Debian has (built where libceres-dev and libmrpt-graphslam-dev are installed).

#include <benchmark/benchmark.h>

#include <cmath>

#include "../src/contour.hpp"
#include "../tests/wall_world.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/mapping/pose_graph.hpp"

#ifdef VESTIBULE_HAS_CERES
#include <ceres/ceres.h>
#endif
#ifdef VESTIBULE_HAS_GRAPHSLAM
#include <mrpt/graphs/CNetworkOfPoses.h>
#include <mrpt/graphslam/levmarq.h>
#endif

namespace vestibule::mapping {
namespace {

void comparisonOfTwoScans(benchmark::State& state) {
  const WallWorld world = WallWorld::ring();
  RandomStream random(1, "bench");
  const Pose2 T_a{18.6, 1.2, 1.0};
  const Pose2 T_b{18.9, 1.0, 0.8};
  const Contour a(world.scan(T_a, {}, random), 25.0);
  const Contour b(world.scan(T_b, {}, random), 25.0);
  const Pose2 T_a_b = between(T_a, T_b);
  for (auto _ : state) benchmark::DoNotOptimize(pointToLine(a, b, T_a_b, {}));
}
BENCHMARK(comparisonOfTwoScans)->Unit(benchmark::kMicrosecond);

/// Rounds of a circle with noise, one closure every eighth node after the first round.
struct Rounds {
  std::vector<Pose2> start;
  std::vector<PoseConstraint> constraints;

  explicit Rounds(std::size_t nodes) {
    constexpr std::size_t kPerRound = 500;
    RandomStream random(2, "rounds");
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    information.diagonal() << 1e4, 1e4, 1e5;
    std::vector<Pose2> truth;
    for (std::size_t i = 0; i < nodes; ++i) {
      const double a = 2.0 * kPi * static_cast<double>(i) / kPerRound;
      truth.push_back({20.0 * std::cos(a) - 20.0, 20.0 * std::sin(a), wrapToPi(a + kPi / 2.0)});
    }
    const auto measured = [&](std::size_t a, std::size_t b, bool closure) {
      Pose2 T = between(truth[a], truth[b]);
      T.x += random.normal(0.0, 0.01);
      T.y += random.normal(0.0, 0.01);
      T.phi += random.normal(0.0, 0.003);
      constraints.push_back({a, b, T, information, closure});
      return T;
    };
    start.push_back(truth.front());
    for (std::size_t i = 1; i < nodes; ++i) {
      start.push_back(compose(start.back(), measured(i - 1, i, false)));
    }
    for (std::size_t i = kPerRound; i < nodes; i += 8) measured(i - kPerRound, i, true);
  }
};

void poseGraphRobust(benchmark::State& state) {
  const Rounds rounds(static_cast<std::size_t>(state.range(0)));
  for (auto _ : state) {
    benchmark::DoNotOptimize(optimisePoseGraph(rounds.start, rounds.constraints));
  }
}
BENCHMARK(poseGraphRobust)->Arg(1000)->Arg(3000)->Unit(benchmark::kMillisecond);

void poseGraphQuadratic(benchmark::State& state) {
  Rounds rounds(static_cast<std::size_t>(state.range(0)));
  for (auto& c : rounds.constraints) c.doubtful = false;
  double chi2 = 0.0;
  for (auto _ : state) chi2 = optimisePoseGraph(rounds.start, rounds.constraints).chi2;
  state.counters["chi2"] = chi2;
}
BENCHMARK(poseGraphQuadratic)->Arg(1000)->Arg(3000)->Unit(benchmark::kMillisecond);

double chi2Of(const std::vector<PoseConstraint>& constraints, const std::vector<Pose2>& poses) {
  double sum = 0.0;
  for (const PoseConstraint& c : constraints) {
    const Eigen::Vector3d r = residual(c, poses);
    sum += r.dot(c.information * r);
  }
  return sum;
}

#ifdef VESTIBULE_HAS_CERES
struct EdgeCost {
  PoseConstraint c;
  Eigen::Matrix3d root;
  template <class T>
  bool operator()(const T* a, const T* b, T* r) const {
    using std::cos;
    using std::sin;
    const T dx = b[0] - a[0];
    const T dy = b[1] - a[1];
    const T turn = b[2] - a[2] - T(c.T_from_to.phi);
    Eigen::Matrix<T, 3, 1> e;
    e << cos(a[2]) * dx + sin(a[2]) * dy - T(c.T_from_to.x),
        -sin(a[2]) * dx + cos(a[2]) * dy - T(c.T_from_to.y),
        turn - T(2.0 * kPi) * ceres::floor((turn + T(kPi)) / T(2.0 * kPi));
    Eigen::Map<Eigen::Matrix<T, 3, 1>>{r} = root.cast<T>() * e;
    return true;
  }
};

void poseGraphCeres(benchmark::State& state) {
  const Rounds rounds(static_cast<std::size_t>(state.range(0)));
  std::vector<Pose2> poses;
  for (auto _ : state) {
    std::vector<std::array<double, 3>> x;
    for (const Pose2& T : rounds.start) x.push_back({T.x, T.y, T.phi});
    ceres::Problem problem;
    for (const PoseConstraint& c : rounds.constraints) {
      const Eigen::Matrix3d root = c.information.llt().matrixU();
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<EdgeCost, 3, 3, 3>(new EdgeCost{c, root}),
          nullptr,
          x[c.from].data(),
          x[c.to].data());
    }
    problem.SetParameterBlockConstant(x[0].data());
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    poses.clear();
    for (const auto& p : x) poses.push_back({p[0], p[1], p[2]});
  }
  state.counters["chi2"] = chi2Of(rounds.constraints, poses);
}
BENCHMARK(poseGraphCeres)->Arg(1000)->Arg(3000)->Unit(benchmark::kMillisecond);
#endif

#ifdef VESTIBULE_HAS_GRAPHSLAM
void poseGraphMrpt(benchmark::State& state) {
  const Rounds rounds(static_cast<std::size_t>(state.range(0)));
  std::vector<Pose2> poses;
  for (auto _ : state) {
    mrpt::graphs::CNetworkOfPoses2DInf graph;
    for (std::size_t i = 0; i < rounds.start.size(); ++i) {
      graph.nodes[i] = mrpt::poses::CPose2D(rounds.start[i]);
    }
    for (const PoseConstraint& c : rounds.constraints) {
      mrpt::poses::CPosePDFGaussianInf edge;
      edge.mean = mrpt::poses::CPose2D(c.T_from_to);
      edge.cov_inv.asEigen() = c.information;
      graph.insertEdge(c.from, c.to, edge);
    }
    graph.root = 0;
    mrpt::containers::yaml options;
    options["max_iterations"] = 100;
    mrpt::graphslam::TResultInfoSpaLevMarq info;
    mrpt::graphslam::optimize_graph_spa_levmarq(graph, info, nullptr, options);
    poses.clear();
    for (const auto& node : graph.nodes) poses.push_back(node.second.asTPose());
  }
  state.counters["chi2"] = chi2Of(rounds.constraints, poses);
}
BENCHMARK(poseGraphMrpt)->Arg(1000)->Arg(3000)->Unit(benchmark::kMillisecond);
#endif

}  // namespace
}  // namespace vestibule::mapping

BENCHMARK_MAIN();
