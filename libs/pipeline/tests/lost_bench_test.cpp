#include "vestibule/pipeline/lost_bench.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "test_files.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::pipeline {
namespace {

void quietly(double, double) {}

LostSample said(double probability, bool lost) {
  LostSample s;
  s.probability = probability;
  s.lost = lost;
  return s;
}

std::vector<std::string> namesOf(const std::vector<LostPlace>& places) {
  std::vector<std::string> names;
  for (const LostPlace& place : places) names.push_back(place.name);
  return names;
}

TEST(Reliability, IsTheMeanGapOfTheBinsWithEveryPlaceCountedTheSame) {
  // GIVEN a place that says 0.05 and is lost in one sample of four, and one that is always right
  const std::vector<LostSample> careless{
      said(0.05, false), said(0.05, false), said(0.05, true), said(0.05, false)};
  const std::vector<LostSample> right{said(0.95, true)};

  const Reliability r = reliabilityOf({careless, right});

  // THEN by hand
  EXPECT_NEAR(r.expected_calibration_error, 0.5 * 0.2 + 0.5 * 0.05, 1e-12);
  EXPECT_NEAR(r.lost_share, 0.5 * 0.25 + 0.5, 1e-12);
  const double brier = 0.5 * (0.75 * 0.0025 + 0.25 * 0.9025) + 0.5 * 0.0025;
  EXPECT_NEAR(r.brier_score, brier, 1e-12);
  EXPECT_NEAR(r.skill, 1.0 - brier / (0.625 * 0.375), 1e-12);
  EXPECT_NEAR(r.bins.front().lost_share, 0.25, 1e-12);
  EXPECT_NEAR(r.bins.back().mean_probability, 0.95, 1e-12);
}

TEST(Reliability, HasNoSkillWhereAlwaysTheMeanIsSaid) {
  const Reliability r = reliabilityOf({{said(0.5, true), said(0.5, false)}});

  EXPECT_NEAR(r.expected_calibration_error, 0.0, 1e-12);
  EXPECT_NEAR(r.skill, 0.0, 1e-12);
}

TEST(LostModel, AFitFindsTheWeightsThatMadeTheSamples) {
  // GIVEN evidence drawn at random, and samples lost as often as a known model says
  RandomStream rng(5, "lost-model");
  amcl::LostFeatures truth;
  truth << 1.0, -1.5, 0.5, -0.5, 0.4, 0.8, 1.2, 0.6;
  std::vector<LostSample> samples(40000);
  for (LostSample& s : samples) {
    amcl::LostEvidence& e = s.evidence;
    e.agreeing_share = rng.uniform();
    e.slow_agreeing_share = rng.uniform();
    e.sharp_share = rng.uniform();
    e.off_map_share = rng.uniform();
    e.spread_m = rng.uniform(0.0, 1.0);
    e.worst_blocked_share = rng.uniform(0.0, 0.5);
    e.weakest_sigma_m = rng.uniform(0.01, 1.0);
    s.lost = rng.bernoulli(amcl::lostProbability(truth, amcl::lostFeatures(e)));
  }

  const amcl::LostFeatures found = fitLostModel({samples});

  for (Eigen::Index i = 0; i < truth.size(); ++i) EXPECT_NEAR(found[i], truth[i], 0.15) << i;
}

TEST(LostModel, PlacesAreJudgedByAModelThatHasNotSeenThem) {
  // GIVEN a place where being lost looks the other way round
  const auto place = [](bool lost_when_agreeing) {
    std::vector<LostSample> samples(200);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const bool agrees = i % 2 == 0;
      samples[i].evidence.agreeing_share = agrees ? 0.9 : 0.1;
      samples[i].lost = agrees == lost_when_agreeing;
    }
    return samples;
  };

  const auto judged = judgedByOthers({place(false), place(false), place(true)});

  EXPECT_LT(judged[2][0].probability, 0.2);
  EXPECT_TRUE(judged[2][0].lost);
}

TEST(LostPlaces, EveryGivenMapOfAWorldIsOne) {
  const std::string campus = test::shipped("config/worlds/campus.yaml");
  const std::string office = test::shipped("config/worlds/office.yaml");

  EXPECT_THAT(
      namesOf(lostPlaces({}, {campus, office, office}, 1)),
      ::testing::ElementsAre(
          "campus hall", "campus library", "campus workshop", "office", "office 2"));
}

TEST(LostPlaces, AWorldWithoutAGivenMapIsRefusedByName) {
  try {
    (void)lostPlaces({}, {test::shipped("config/worlds/open_field.yaml")}, 1);
    FAIL();
  } catch (const ConfigError& e) {
    EXPECT_THAT(e.what(), ::testing::HasSubstr("open_field.yaml"));
  }
}

class OfficeDrives : public ::testing::Test {
 protected:
  std::vector<LostSample> samples(int threads) const {
    Config config;
    config.amcl.global.search.threads = threads;
    constexpr int kDrives = 15;
    constexpr std::uint64_t kSeed = 21;
    return sampleLost(office_, config, kDrives, kSeed, quietly);
  }

 private:
  LostPlace office_ = simulatedWorld(test::shipped("config/worlds/office.yaml")).front();
};

TEST_F(OfficeDrives, TheLocalizerKnowsWhetherItIsLost) {
  const auto drives = samples(2);

  std::set<Trouble> troubles;
  for (const LostSample& s : drives) troubles.insert(s.trouble);
  EXPECT_EQ(troubles.size(), 5U);
  const Reliability r = reliabilityOf({drives});
  EXPECT_GT(r.lost_share, 0.2);
  EXPECT_LT(r.lost_share, 0.8);
  EXPECT_GT(r.skill, 0.6);
  EXPECT_LT(r.expected_calibration_error, 0.1);  // of 15 drives; `bench lost` takes more
}

TEST_F(OfficeDrives, AreTheSameForAnyNumberOfThreads) {
  const auto one = samples(1);
  const auto two = samples(2);

  ASSERT_EQ(one.size(), two.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    ASSERT_EQ(one[i].probability, two[i].probability) << i;
    ASSERT_EQ(one[i].error_m, two[i].error_m) << i;
  }
}

TEST(BenchGlobal, ARobotInTheOfficeFindsItself) {
  const LostPlace office = simulatedWorld(test::shipped("config/worlds/office.yaml")).front();
  constexpr int kPlaces = 6;

  const auto trials = benchGlobal(office, Config(), kPlaces, 3, quietly);

  int right = 0;
  for (const LostTrial& trial : trials) {
    EXPECT_NE(trial.outcome, LostOutcome::kWrong);
    right += trial.outcome == LostOutcome::kRight ? 1 : 0;
  }
  EXPECT_GE(right, kPlaces - 1);
}

}  // namespace
}  // namespace vestibule::pipeline
