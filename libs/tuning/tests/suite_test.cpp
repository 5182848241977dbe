#include "vestibule/tuning/suite.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>

#include "scenario_log.hpp"
#include "session_target.hpp"
#include "test_files.hpp"
#include "tuning_test_support.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/pipeline/map.hpp"
#include "vestibule/tuning/subjects.hpp"

namespace vestibule::tuning {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using vestibule::test::readFile;
using vestibule::test::shipped;
using vestibule::test::TempFolder;

constexpr const char* kTwoByThree =
    "bench: ekf\n"
    "factors:\n"
    "  - {name: ekf.gyro.noise_rad_sqrt_s, values: [0.001, 0.002]}\n"
    "  - {name: ekf.wheels.distance_sigma_sqrt_m, values: [0.1, 0.2, 0.4]}\n"
    "recordings:\n"
    "  - {scenario: open_sky}\n"
    "objectives:\n"
    "  - {measure: ape}\n"
    "seeds: {first: 5, count: 2}\n";

Suite parsed(const std::string& yaml) {
  return parseSuite(yaml, "suite.yaml", shipped("config/scenarios"));
}

std::string complaint(const std::string& yaml) { return test::complaintOf(parsed, yaml); }

/// Runs a suite on a formula; counts the runs.
SuiteResult done(
    const Suite& suite,
    std::size_t threads,
    const std::string& journal_path,
    std::atomic<int>& runs,
    const Callbacks& callbacks = {}) {
  const test::FormulaSubject subject([&runs](double gyro, double wheels, RandomStream& random) {
    ++runs;
    return 100.0 * gyro + wheels + 0.001 * random.normal();
  });
  const TaskRunner runner(configOfVariant(suite), subject);
  ThreadWorkers workers(runner, threads);
  Journal journal(journal_path, fingerprintOf(suite), true);
  return runSuite(suite, subject, workers, journal, "", callbacks);
}

std::vector<double> scoresOf(const SuiteResult& result) {
  std::vector<double> scores;
  for (const SuiteRun& run : result.runs) scores.push_back(meanScore(run.outcome, 0));
  return scores;
}

TEST(Suite, EveryCombinationIsAVariant) {
  const Suite suite = parsed(kTwoByThree);
  ASSERT_EQ(suite.variants.size(), 6U);
  EXPECT_EQ(suite.variants[1].name, "noise_rad_sqrt_s=0.001 distance_sigma_sqrt_m=0.2");
  EXPECT_EQ(suite.variants[5].config.ekf.gyro.noise_rad_sqrt_s, 0.002);
  EXPECT_EQ(suite.variants[5].config.ekf.wheels.distance_sigma_sqrt_m, 0.4);
}

TEST(Suite, ConfigurationFilesAreVariantsToo) {
  const TempFolder folder;
  const std::string file =
      vestibule::test::writeFile(folder / "slow.yaml", "ekf: {gyro: {noise_rad_sqrt_s: 0.005}}\n");
  const Suite suite = parsed(
      "bench: ekf\nconfigs:\n  - {name: now}\n  - {name: slow, file: " + file +
      "}\nrecordings:\n  - {scenario: open_sky}\nobjectives:\n  - {measure: ape}\n");
  ASSERT_EQ(suite.variants.size(), 2U);
  EXPECT_EQ(suite.variants[1].name, "slow");
  EXPECT_EQ(suite.variants[1].config.ekf.gyro.noise_rad_sqrt_s, 0.005);
}

TEST(Suite, EverythingWrongIsSaidAtOnceWithItsLine) {
  const std::string text = complaint(
      "bench: mapping\n"
      "factors:\n"
      "  - {name: mapping.filter.particle, values: [1]}\n"
      "  - {name: mapping.filter.particles, values: [10, 0.5]}\n"
      "configs:\n"
      "  - {name: a, file: gone.yaml}\n"
      "recordings:\n"
      "  - {scenario: nowhere}\n"
      "objectives:\n"
      "  - {measure: nis}\n");
  EXPECT_THAT(
      text,
      AllOf(
          HasSubstr("suite.yaml:3: factors: mapping.filter.particle: unknown parameter"),
          HasSubstr("suite.yaml:4: factors: at 0.5"),
          HasSubstr("suite.yaml:6: configs[0].file: no such file: gone.yaml"),
          HasSubstr("suite.yaml:8: recordings: "),
          HasSubstr("suite.yaml:10: objectives: nis cannot be measured of mapping")));
  EXPECT_THAT(complaint(""), HasSubstr("bench: missing"));
}

TEST(Suite, SameTableForAnyNumberOfThreads) {
  const Suite suite = parsed(kTwoByThree);
  std::atomic<int> runs{0};
  const SuiteResult one = done(suite, 1, "", runs);
  ASSERT_EQ(one.runs.size(), 6U * 2U * 2U);  // variants, drives of the subject, seeds
  EXPECT_EQ(one.runs[0].run.seed, 5U);
  EXPECT_EQ(scoresOf(done(suite, 4, "", runs)), scoresOf(one));
  EXPECT_NEAR(meanScore(one.runs.front().outcome, 0), 0.2, 0.01);
  EXPECT_NEAR(meanScore(one.runs.back().outcome, 0), 0.6, 0.01);
}

TEST(Suite, GoesOnWhereItWasStopped) {
  const Suite suite = parsed(kTwoByThree);
  const TempFolder folder;
  const std::string journal = folder / "runs.jsonl";
  std::atomic<int> runs{0};
  const std::vector<double> undisturbed = scoresOf(done(suite, 1, "", runs));
  int finished = 0;
  Callbacks callbacks;
  callbacks.status = [&finished](const Status& s) { finished = static_cast<int>(s.done); };
  callbacks.stop = [&finished] { return finished >= 7; };
  const SuiteResult part = done(suite, 1, journal, runs, callbacks);
  EXPECT_TRUE(part.stopped_early);
  EXPECT_LT(part.runs.size(), 24U);
  EXPECT_GE(part.runs.size(), 7U);
  runs = 0;
  const SuiteResult whole = done(suite, 1, journal, runs);
  EXPECT_FALSE(whole.stopped_early);
  EXPECT_EQ(scoresOf(whole), undisturbed);
  // The formula is asked for twelve blocks in each of the runs that were missing.
  EXPECT_EQ(runs.load(), 12 * static_cast<int>(24 - part.runs.size()));
}

TEST(Suite, KeepsTrajectoryAndMapOfEveryRun) {
  const TempFolder folder;
  Suite suite = parsed(
      "bench: mapping\n"
      "factors:\n"
      "  - {name: mapping.filter.particles, values: [2, 3]}\n"
      "recordings:\n"
      "  - {scenario: obstacle_room}\n"
      "objectives:\n"
      "  - {measure: ape}\n"
      "  - {measure: wall_thickness}\n");
  const auto subject = makeSubject(
      suite.runs, {shipped("config/csv"), shipped("config/scenarios")}, [](double, double) {});
  const TaskRunner runner(configOfVariant(suite), *subject);
  ThreadWorkers workers(runner, 2);
  Journal journal("", fingerprintOf(suite), true);
  const SuiteResult result = runSuite(suite, *subject, workers, journal, folder / "runs", {});
  ASSERT_EQ(result.runs.size(), 2U);
  for (const SuiteRun& run : result.runs) {
    EXPECT_EQ(run.outcome.failure, "");
    EXPECT_LT(meanScore(run.outcome, 0), 0.1);
    EXPECT_GT(run.outcome.cpu_s, 0.0);
    EXPECT_GT(readFile(run.folder + "/trajectory.tum").size(), 100U);
    EXPECT_GT(readFile(run.folder + "/map.pgm").size(), 100U);
  }
}

/// A wide matcher forgives what its map gets wrong: maps are compared by one and the same.
TEST(Suite, MapsOfDifferentMatchersAreJudgedByOne) {
  const TempFolder folder;
  const std::string log = folder / "room.rawlog";
  (void)vestibule::test::recordScenario(vestibule::test::shippedScenario("obstacle_room"), 1, log);
  pipeline::Config config;
  config.mapping.filter.particles = 2;
  const auto likelihood = [&](const std::optional<mapping::MatcherParams>& judge) {
    pipeline::MapDriveOptions options;
    options.judge = judge;
    return pipeline::mapDrive(log, {}, options, config, Observers{}, [](double, double) {})
        .quality.held_out_log_likelihood;
  };
  mapping::MatcherParams wide = config.mapping.filter.matcher;
  wide.sigma_m *= 4.0;
  EXPECT_EQ(likelihood(std::nullopt), likelihood(config.mapping.filter.matcher));
  EXPECT_GT(likelihood(wide), likelihood(std::nullopt) + 0.02);
}

TEST(Suite, DamagedOnesAreReadOrComplainedOf) {
  RandomStream random(1, "damage");
  const std::string bytes = kTwoByThree;
  for (int k = 0; k < 200; ++k) {
    std::string damaged = bytes;
    damaged[random() % damaged.size()] = static_cast<char>(random() % 256);
    damaged.erase(random() % damaged.size(), random() % 20);
    EXPECT_NO_THROW(fuzz::readSuite(damaged)) << damaged;
  }
}

}  // namespace
}  // namespace vestibule::tuning
