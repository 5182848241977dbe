#include "vestibule/tuning/scoring.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "vestibule/core/random.hpp"

namespace vestibule::tuning {
namespace {

Evaluation scored(const std::vector<double>& values, int first_block = 0) {
  Evaluation e;
  e.cases = {{0, 1}};
  e.outcomes.resize(1);
  e.outcomes[0].objectives.emplace_back();
  for (std::size_t i = 0; i < values.size(); ++i) {
    e.outcomes[0].objectives[0].push_back({first_block + static_cast<int>(i), values[i]});
  }
  return e;
}

const std::vector<Objective> kMetres{Objective{Measure::kApe, 1.0, 30.0, 10.0, {}}};
const std::vector<Objective> kLogs{Objective{Measure::kInnovation, 1.0, 30.0, 10.0, {}}};

TEST(Scoring, CostOfTheDefaultsIsOne) {
  const Evaluation e = scored({1, 2, 3, 4});
  EXPECT_DOUBLE_EQ(relativeCost(kMetres, e, e), 1.0);
  EXPECT_DOUBLE_EQ(relativeCost(kLogs, e, e), 1.0);
}

TEST(Scoring, MetresAreARatioAndLogarithmsADifference) {
  EXPECT_NEAR(relativeCost(kMetres, scored({2, 4, 6}), scored({1, 2, 3})), 0.5, 1e-12);
  EXPECT_NEAR(relativeCost(kLogs, scored({-1, -2, 6}), scored({-2, -3, 5})), std::exp(-1.0), 1e-12);
}

TEST(Scoring, AConsistentFilterHasNeesOfOne) {
  const std::vector<Objective> nees{Objective{Measure::kNees, 1.0, 30.0, 10.0, {}}};
  const Evaluation over = scored({0.1, 0.1, 0.1});  // claims three times its error
  const Evaluation under = scored({10, 10, 10});    // claims a third of it
  EXPECT_NEAR(relativeCost(nees, over, under), 1.0, 1e-9);
  EXPECT_LT(relativeCost(nees, over, scored({1.1, 0.9, 1.0})), 0.11);
}

TEST(Scoring, WhoSkipsBlocksOrIsNotFiniteCannotBeCompared) {
  const Evaluation all = scored({1, 1, 1, 1, 1, 1, 1, 1, 1, 1});
  EXPECT_EQ(relativeCost(kMetres, all, scored({1, 1, 1})), kPenalty);
  EXPECT_THAT(whyNotComparable(all, scored({1, 1, 1})), testing::HasSubstr("3 of 10 blocks"));
  EXPECT_EQ(relativeCost(kMetres, all, scored({1, 1, 1, 1, 1, 1, 1, 1, 1, NAN})), kPenalty);
}

TEST(Scoring, AGainIsOnlySignificantWhenItIsSteady) {
  RandomStream random(3, "gain");
  std::vector<double> before;
  std::vector<double> steady;
  std::vector<double> lucky;
  for (int i = 0; i < 20; ++i) {
    before.push_back(1.0 + random.uniform());
    steady.push_back(0.8 * before.back());
    lucky.push_back(i == 0 ? 0.1 : before.back());
  }
  before[0] = 6.0;
  lucky[0] = 0.1;
  const Gain good = compare(kMetres, scored(before), scored(steady), 0.95, 1);
  EXPECT_TRUE(good.significant(0.95));
  const Gain luck = compare(kMetres, scored(before), scored(lucky), 0.95, 1);
  EXPECT_GT(luck.gain, 0.05);
  EXPECT_FALSE(luck.significant(0.95));
}

TEST(Scoring, FewBlocksAreNeverSignificant) {
  const Gain g = compare(
      kMetres, scored({1, 1, 1, 1, 1, 1, 1}), scored({.5, .5, .5, .5, .5, .5, .5}), 0.95, 1);
  EXPECT_NEAR(g.gain, 0.5, 1e-12);
  EXPECT_FALSE(g.significant(0.95));
}

/// Coverage of the interval: 200 experiments of 15 noisy pairs with a true gain of 20 %.
TEST(Scoring, TheIntervalCoversTheTruth) {
  int covered = 0;
  for (std::uint64_t k = 0; k < 200; ++k) {
    RandomStream random(11, "coverage", k);
    std::vector<double> before;
    std::vector<double> after;
    for (int i = 0; i < 15; ++i) {
      before.push_back(std::exp(0.3 * random.normal()));
      after.push_back(0.8 * std::exp(0.3 * random.normal()));
    }
    const Gain g = compare(kMetres, scored(before), scored(after), 0.95, k);
    covered += g.low <= 0.2 && 0.2 <= g.high ? 1 : 0;
  }
  EXPECT_GE(covered, 170);
}

}  // namespace
}  // namespace vestibule::tuning
