#include "vestibule/tuning/engine.hpp"

#include <gmock/gmock.h>

#include <filesystem>

#include "test_files.hpp"
#include "tuning_test_support.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::tuning::test {
namespace {

using testing::HasSubstr;
using vestibule::test::readFile;
using vestibule::test::TempFolder;
using vestibule::test::writeFile;

TEST(Engine, FindsAKnownOptimumAndSaysSo) {
  const TuningResult r = tuned(twoParameters(), FormulaSubject(bowl));
  EXPECT_TRUE(r.accepted) << r.verdict;
  EXPECT_NEAR(std::log10(r.winner[0] / 5e-4), 0.0, 0.1) << r.winner[0];
  EXPECT_NEAR(std::log10(r.winner[1] / 0.2), 0.0, 0.15) << r.winner[1];
  EXPECT_THAT(r.verdict, HasSubstr("tuned: validation: gain"));
  EXPECT_EQ(r.left_out.size(), 2U);
  EXPECT_GT(r.validation.low, 0.05);
}

TEST(Engine, EveryAlgorithmFindsIt) {
  for (const GlobalAlgorithm global :
       {GlobalAlgorithm::kDirectL, GlobalAlgorithm::kCrs2, GlobalAlgorithm::kIsres}) {
    for (const LocalAlgorithm local : {LocalAlgorithm::kBobyqa, LocalAlgorithm::kSbplx}) {
      Session session = twoParameters();
      session.search.global = global;
      session.search.local = local;
      const TuningResult r = tuned(session, FormulaSubject(bowl));
      EXPECT_TRUE(r.accepted) << r.algorithms << ": " << r.verdict;
      EXPECT_LE(r.tried.size(), 80U) << r.algorithms;
    }
  }
}

TEST(Engine, ResultDoesNotDependOnThreads) {
  const TempFolder folder;
  const FormulaSubject subject(bowl);
  const TuningResult one = tuned(twoParameters(), subject, 1, folder / "one.jsonl");
  const TuningResult three = tuned(twoParameters(), subject, 3, folder / "three.jsonl");
  EXPECT_EQ(one.winner, three.winner);
  EXPECT_EQ(readFile(folder / "one.jsonl"), readFile(folder / "three.jsonl"));
}

TEST(Engine, ResumesAfterAKillAtAnyMoment) {
  const TempFolder folder;
  const FormulaSubject subject(bowl);
  const TuningResult whole = tuned(twoParameters(), subject, 1, folder / "whole.jsonl");
  const std::string journal = readFile(folder / "whole.jsonl");
  RandomStream random(7, "kill");
  for (int k = 0; k < 20; ++k) {
    const std::size_t cut = random() % journal.size();
    const std::string path = folder / ("cut" + std::to_string(k) + ".jsonl");
    writeFile(path, journal.substr(0, cut));
    const TuningResult resumed = tuned(twoParameters(), subject, 1, path);
    EXPECT_EQ(resumed.winner, whole.winner) << "cut at byte " << cut;
    EXPECT_EQ(resumed.verdict, whole.verdict) << "cut at byte " << cut;
    EXPECT_EQ(readFile(path), journal) << "cut at byte " << cut;
  }
}

TEST(Engine, RefusesTheJournalOfAnotherSession) {
  const TempFolder folder;
  const FormulaSubject subject(bowl);
  Session session = twoParameters();
  session.search.evaluations = 4;
  (void)tuned(session, subject, 1, folder / "e.jsonl");
  session.search.evaluations = 6;
  try {
    (void)tuned(session, subject, 1, folder / "e.jsonl");
    ADD_FAILURE() << "was taken";
  } catch (const ConfigError& e) {
    EXPECT_THAT(e.what(), HasSubstr("belongs to another session"));
  }
}

TEST(Engine, ADivergingRegionCostsAPenaltyAndIsRecorded) {
  const TempFolder folder;
  const FormulaSubject subject([](double gyro, double wheels, RandomStream& random) {
    return gyro < 3e-4 ? std::nan("") : bowl(gyro, wheels, random);
  });
  const TuningResult r = tuned(twoParameters(), subject, 1, folder / "e.jsonl");
  EXPECT_TRUE(r.accepted) << r.verdict;
  EXPECT_GT(r.failures, 0U);
  EXPECT_GE(r.winner[0], 3e-4);
  EXPECT_THAT(readFile(folder / "e.jsonl"), HasSubstr("\"failure\":\"diverged\""));
}

TEST(Engine, StoppedEarlyItStillJudgesWhatItFound) {
  int rounds = 0;
  Callbacks callbacks;
  callbacks.stop = [&rounds] { return ++rounds >= 15; };
  const TuningResult r = tuned(twoParameters(), FormulaSubject(bowl), 1, "", callbacks);
  EXPECT_TRUE(r.stopped_early);
  EXPECT_EQ(r.tried.size(), 30U);  // two islands
  EXPECT_THAT(r.verdict, HasSubstr("validation: "));
}

TEST(Engine, KeepsTheDefaultsWhereTheyAreTheBest) {
  Session session = twoParameters();
  session.base.ekf.gyro.noise_rad_sqrt_s = 5e-4;
  session.base.ekf.wheels.distance_sigma_sqrt_m = 0.2;
  const TuningResult r = tuned(session, FormulaSubject(bowl));
  EXPECT_FALSE(r.accepted);
  EXPECT_THAT(r.verdict, HasSubstr("keep the defaults"));
}

TEST(Engine, SmallGainIsNotWorthAChange) {
  const TuningResult r =
      tuned(twoParameters(), FormulaSubject([](double gyro, double, RandomStream& random) {
              return 1.0 + 0.03 * std::pow(std::log10(gyro / 5e-4), 2) + 1e-4 * random.normal();
            }));
  EXPECT_FALSE(r.accepted);
  EXPECT_TRUE(r.validation.significant(0.95));
  EXPECT_THAT(r.verdict, HasSubstr("the gain is below 5 %"));
}

TEST(Engine, DefaultsThatCannotRunAreAnInputError) {
  const FormulaSubject broken([](double, double, RandomStream&) { return std::nan(""); });
  EXPECT_THROW((void)tuned(twoParameters(), broken), InputError);
}

/// Recordings that decide cannot give what is measured: nothing is searched for.
TEST(Engine, WhatValidationCannotGiveIsKnownBeforeTheSearch) {
  class Mute : public FormulaSubject {
   public:
    using FormulaSubject::FormulaSubject;
    [[nodiscard]] Outcome run(
        const pipeline::Config& config,
        Role role,
        std::size_t drive,
        std::uint64_t seed,
        const std::string& folder) const override {
      Outcome outcome = FormulaSubject::run(config, role, drive, seed, folder);
      if (role == Role::kValidation && drive == 0) outcome.failure = "no fixes";
      if (role == Role::kValidation && drive == 1) outcome.objectives.front().clear();
      return outcome;
    }
  };
  std::size_t candidates = 0;
  Callbacks callbacks;
  callbacks.status = [&candidates](const Status& s) { candidates += s.stage == "search" ? 1 : 0; };
  try {
    (void)tuned(twoParameters(), Mute(bowl), 1, "", callbacks);
    ADD_FAILURE() << "was run";
  } catch (const InputError& e) {
    EXPECT_THAT(
        e.what(),
        HasSubstr("recordings.validation: validation 0: the defaults cannot be "
                  "run: no fixes"));
    EXPECT_THAT(e.what(), HasSubstr("validation 1: the defaults give no number of ape"));
  }
  EXPECT_EQ(candidates, 0U);
}

/// Errors that no parameter changes: whatever the search finds is luck. The bar is 95 of 100; with
/// a two-sided 95 % test and 5 % least gain about 1 in 100 gets through.
TEST(Engine, APureNoiseObjectiveIsRefused) {
  const FormulaSubject noise(
      [](double, double, RandomStream& random) { return random.exponential(1.0); });
  int refused = 0;
  for (std::uint64_t repetition = 1; repetition <= 100; ++repetition) {
    Session session = twoParameters();
    session.search.evaluations = 40;
    session.seeds.first = repetition * 100000;
    refused += tuned(session, noise).accepted ? 0 : 1;
  }
  RecordProperty("refused_of_100", refused);
  EXPECT_GE(refused, 95);
}

}  // namespace
}  // namespace vestibule::tuning::test
