#include "vestibule/geo/georeference.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::geo {
namespace {

const Pose2 kTruth{120.0, -40.0, 0.6};

/// Positions on a loop of 40 m with noisy fixes of them.
std::vector<GeoPair> loop(double sigma_m, std::uint64_t seed) {
  RandomStream rng(seed, "georeference");
  std::vector<GeoPair> pairs;
  for (int i = 0; i < 200; ++i) {
    const double t = 2.0 * kPi * i / 200.0;
    const Point2 p{20.0 * std::cos(t), 12.0 * std::sin(t)};
    const Point2 q = transform(kTruth, p);
    pairs.push_back({{q.x + rng.normal(0.0, sigma_m), q.y + rng.normal(0.0, sigma_m)}, p, sigma_m});
  }
  return pairs;
}

TEST(Georeference, CovarianceIsHonest) {
  // Normalised squared errors of 200 fits: mean 3, standard error sqrt(6 / 200) = 0.17.
  double sum = 0.0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const auto fit = fitGeoreference(loop(0.5, seed), 1.0);
    ASSERT_TRUE(fit);
    const Eigen::Vector3d e(
        fit->T_map_grid.mean.x - kTruth.x,
        fit->T_map_grid.mean.y - kTruth.y,
        angleDiff(fit->T_map_grid.mean.phi, kTruth.phi));
    sum += e.dot(fit->T_map_grid.cov.inverse() * e);
  }
  EXPECT_NEAR(sum / 200.0, 3.0, 0.8);  // the robust weights cost a little
}

TEST(Georeference, AFewBadFixesDoNotMoveIt) {
  auto pairs = loop(0.05, 3);
  for (std::size_t i = 0; i < pairs.size(); i += 10) pairs[i].p_enu += Eigen::Vector2d(80.0, -30.0);
  const auto fit = fitGeoreference(pairs, 1.0);
  ASSERT_TRUE(fit);
  EXPECT_LT(distance(fit->T_map_grid.mean, kTruth), 0.1);
  // Of good pairs 84 % lie near enough to count with half weight or more; of the bad ones none.
  EXPECT_LE(fit->used, 180U);
  EXPECT_GT(fit->used, 140U);
}

TEST(Georeference, CorrelatedFixesCountLess) {
  const auto pairs = loop(0.5, 4);
  EXPECT_NEAR(
      fitGeoreference(pairs, 50.0)->T_map_grid.cov(0, 0) /
          fitGeoreference(pairs, 1.0)->T_map_grid.cov(0, 0),
      50.0,
      1e-6);
}

TEST(Georeference, NeedsAWayToSeeTheHeading) {
  EXPECT_FALSE(fitGeoreference({}, 1.0));
  std::vector<GeoPair> still(50, GeoPair{{1.0, 2.0}, {0.0, 0.0}, 1.0});
  EXPECT_FALSE(fitGeoreference(still, 1.0));
}

}  // namespace
}  // namespace vestibule::geo
