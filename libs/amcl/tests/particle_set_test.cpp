#include "../src/particle_set.hpp"

#include <gtest/gtest.h>
#include <mrpt/bayes/CParticleFilter.h>

#include <cmath>

#include "../src/clusters.hpp"
#include "../src/motion_model.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::amcl {
namespace {

grid::OccupancyMap clutteredMap() {
  RandomStream rng(3, "map");
  std::vector<grid::Cell> cells(200 * 150, grid::Cell::kFree);
  for (grid::Cell& cell : cells) {
    if (rng.uniform() < 0.03) cell = grid::Cell::kOccupied;
  }
  return grid::OccupancyMap::fromCells(200, 150, 0.05, {0, 0}, cells);
}

/// Ends to all sides, some of which leave the map.
std::vector<Point2> star() {
  std::vector<Point2> ends;
  for (int i = 0; i < 77; ++i) {
    const double r = 1.0 + 0.08 * i;
    ends.push_back({r * std::cos(0.3 * i), r * std::sin(0.3 * i)});
  }
  return ends;
}

/// Some updates with resampling; what remains of the particles.
std::vector<Pose2> afterUpdates(std::size_t n, int threads, Simd simd) {
  const auto map = clutteredMap();
  const grid::DistanceField field(map);
  const LikelihoodTable table(map, field, {});
  ParticleSet particles(table, threads, simd);
  particles.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto k = static_cast<double>(i);
    particles.set(i, {5.0 + std::sin(k), 4.0 + std::cos(k), 0.01 * k});
  }
  mrpt::bayes::CParticleFilter driver;
  driver.m_options.adaptiveSampleSize = true;
  driver.m_options.powFactor = 0.2;
  const auto ends = star();
  for (std::uint64_t step = 0; step < 3; ++step) {
    ParticleStep what;
    what.increment = noisyIncrement(likelyMotion({{0.1, 0.0, 0.05}, 0.1, 0.05, 0.0}, {}));
    what.noise.seed = {7, 8};
    what.noise.step = step;
    what.ends = &ends;
    particles.prepare(what);
    driver.executeOn(particles, nullptr, nullptr);
    particles.resample(n, 0.37);
  }
  std::vector<Pose2> poses;
  for (std::size_t i = 0; i < n; ++i) poses.push_back(particles.pose(i));
  return poses;
}

TEST(ParticleSet, TheSameBitsForAnyNumberOfThreadsWithAndWithoutVectorInstructions) {
  const auto expected = afterUpdates(20011, 1, Simd::kPortable);
  for (const int threads : {2, 3, 7}) {
    EXPECT_EQ(afterUpdates(20011, threads, Simd::kPortable), expected) << threads << " threads";
  }
  if (bestSimd() == Simd::kPortable) GTEST_SKIP() << "no vector instructions here";
  EXPECT_EQ(afterUpdates(20011, 1, bestSimd()), expected);
  EXPECT_EQ(afterUpdates(20011, 4, bestSimd()), expected);
}

TEST(ParticleSet, WeighsAsTheFormulaSays) {
  const auto map = clutteredMap();
  const grid::DistanceField field(map);
  const LikelihoodField params;
  const LikelihoodTable table(map, field, params);
  ParticleSet particles(table, 1);
  particles.resize(50);
  RandomStream rng(4, "poses");
  // The turned scan of a bin stands for all yaws in it: poses in the middle of bins.
  const double bin = 2.0 * kPi / 1800.0;
  for (std::size_t i = 0; i < 50; ++i) {
    const double yaw = (std::floor(rng.uniform(-800, 800)) + 0.5) * bin;
    particles.set(i, {rng.uniform(0, 10), rng.uniform(0, 7.5), yaw});
  }
  const auto ends = star();
  const auto& fits = particles.logLikelihoods(ends);
  for (std::size_t i = 0; i < 50; ++i) {
    double sum = 0.0;
    for (const Point2& end : ends) {
      const double d = field.atGrid(transform(particles.pose(i), end), 1e9);
      const double u = std::min(d, params.max_distance_m) / params.sigma_hit_m;
      sum += std::log(params.z_hit * std::exp(-0.5 * u * u) + params.z_rand / params.max_range_m);
    }
    // An end on the border of two cells may fall into either.
    EXPECT_NEAR(fits[i], sum, 0.02 * static_cast<double>(ends.size()));
  }
}

TEST(ParticleSet, MovesByGaussianIncrements) {
  const auto map = clutteredMap();
  const grid::DistanceField field(map);
  const LikelihoodTable table(map, field, {});
  ParticleSet particles(table, 1);
  constexpr std::size_t kCount = 100000;
  particles.resize(kCount);
  for (std::size_t i = 0; i < kCount; ++i) particles.set(i, {2.0, 3.0, kPi / 2.0});
  PoseWithCovariance step;
  step.mean = {0.5, 0.0, 0.1};
  step.cov << 0.04, 0.01, 0.002, 0.01, 0.01, 0.004, 0.002, 0.004, 0.0025;
  particles.diffuse(noisyIncrement(step), {{1, 2}, 3, 4});
  const PoseWithCovariance moved = particles.moments();
  // Facing north, ahead is +y and left is -x. Limits: five standard errors of 100000 draws.
  EXPECT_NEAR(moved.mean.x, 2.0, 0.0016);
  EXPECT_NEAR(moved.mean.y, 3.5, 0.0032);
  EXPECT_NEAR(moved.mean.phi, kPi / 2.0 + 0.1, 0.0008);
  EXPECT_NEAR(moved.cov(1, 1), 0.04, 0.001);
  EXPECT_NEAR(moved.cov(0, 0), 0.01, 0.0003);
  EXPECT_NEAR(moved.cov(2, 2), 0.0025, 0.0001);
  EXPECT_NEAR(moved.cov(1, 0), -0.01, 0.0005);
  EXPECT_NEAR(moved.cov(1, 2), 0.002, 0.0002);
  EXPECT_NEAR(moved.cov(0, 2), -0.004, 0.0002);
}

TEST(ParticleSet, SystematicDrawsFollowTheWeights) {
  const auto map = clutteredMap();
  const grid::DistanceField field(map);
  const LikelihoodTable table(map, field, {});
  ParticleSet particles(table, 1);
  particles.resize(4);
  const double weights[] = {0.1, 0.0, 0.6, 0.3};
  for (std::size_t i = 0; i < 4; ++i) particles.setW(i, std::log(weights[i] + 1e-30));
  particles.normalizeWeights();
  std::vector<int> count(4, 0);
  for (const std::uint32_t i : particles.systematicDraws(1000, 0.5)) ++count[i];
  EXPECT_NEAR(count[0], 100, 1);
  EXPECT_EQ(count[1], 0);
  EXPECT_NEAR(count[2], 600, 1);
  EXPECT_NEAR(count[3], 300, 1);
}

TEST(Clusters, TellPlacesApartAcrossTheWrapOfYaw) {
  const auto map = clutteredMap();
  const grid::DistanceField field(map);
  const LikelihoodTable table(map, field, {});
  ParticleSet particles(table, 1);
  particles.resize(300);
  RandomStream rng(9, "places");
  for (std::size_t i = 0; i < 300; ++i) {
    // GIVEN one place about yaw pi with two thirds of the particles, another 5 m away
    const bool first = i % 3 != 0;
    particles.set(
        i,
        {rng.normal(first ? 2.0 : 7.0, 0.1),
         rng.normal(3.0, 0.1),
         rng.normal(first ? kPi : 0.0, 0.1)});
  }
  particles.normalizeWeights();
  const Clusters found = findClusters(particles, 0.5, degToRad(15.0));
  ASSERT_GE(found.clusters.size(), 2U);
  EXPECT_NEAR(found.clusters[0].weight, 2.0 / 3.0, 0.03);
  EXPECT_NEAR(found.clusters[0].T_grid_base.mean.x, 2.0, 0.05);
  EXPECT_NEAR(std::abs(found.clusters[0].T_grid_base.mean.phi), kPi, 0.05);
  EXPECT_NEAR(found.clusters[1].T_grid_base.mean.x, 7.0, 0.05);
}

TEST(Kld, SampleSizesAreThoseOfThePaper) {
  // k = 50 bins, epsilon 0.05, delta 0.01: (k-1)/(2 eps) (1 - a + sqrt(a) 2.3263)^3, a = 2/(9*49).
  EXPECT_NEAR(static_cast<double>(kldSampleSize(50, 0.05, 0.01)), 748.0, 3.0);
  EXPECT_EQ(kldSampleSize(1, 0.05, 0.01), 1U);
  EXPECT_GT(kldSampleSize(51, 0.05, 0.01), kldSampleSize(50, 0.05, 0.01));
}

}  // namespace
}  // namespace vestibule::amcl
