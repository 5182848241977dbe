// vestibule tune and calibrate: sessions with errors, a session killed and resumed, refusals.

#include "cli_fixture.hpp"

namespace vestibule::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class Tune : public Cli {
 protected:
  /// A few seconds of work: even against odd blocks of the Husky, six candidates.
  [[nodiscard]] std::string smallSession() const {
    return file(
        "small.yaml",
        "parameters:\n"
        "  - {name: ekf.gnss.sigma_single_m, from: 0.5, to: 20}\n"
        "  - {name: ekf.gyro.noise_rad_sqrt_s, from: 0.0002, to: 0.02}\n"
        "recordings:\n"
        "  training: [{log: " +
            shipped("datasets/husky_gnss/test1.bag") +
            ", blocks: even}]\n"
            "  validation: [{log: " +
            shipped("datasets/husky_gnss/test1.bag") +
            ", blocks: odd}]\n"
            "block_s: 20\n"
            "objectives: [{measure: innovation_likelihood}]\n"
            "search: {evaluations: 6, slices: false}\n");
  }
};

TEST_F(Tune, EveryErrorOfASessionIsNamedWithItsLineBeforeAnythingRuns) {
  const std::string session = file(
      "bad.yaml",
      "parameters:\n"
      "  - {name: ekf.gyro.noise, from: 0.0002, to: 0.02}\n"
      "  - {name: ekf.wheels.scale_sigma, from: 0.3, to: 0.01}\n"
      "recordings:\n"
      "  training: [{log: gone.bag}, {scenario: open_sky}]\n"
      "  validation: [{scenario: open_sky}]\n"
      "objectives: [{measure: innovation_likelihood}]\n");
  const CommandResult result = run({"tune", session, "--out", path("out")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(
      result.err,
      AllOf(
          HasSubstr("bad.yaml:2: parameters: ekf.gyro.noise: unknown parameter"),
          HasSubstr("bad.yaml:3: parameters[1].to: empty range"),
          HasSubstr("bad.yaml:5: recordings.training[0].log: no such file"),
          HasSubstr("bad.yaml:6: recordings.validation: open_sky is in training too (line 5)")));
  expectNoOutput("out");
}

TEST_F(Tune, SaysItsVerdictAndLeavesWhatWasTried) {
  const std::string session = smallSession();
  const CommandResult result = run({"tune", session, "--out", path("out")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.err, "");
  EXPECT_THAT(result.out, HasSubstr("validation: gain"));
  EXPECT_THAT(
      finalFiles(path("out")),
      testing::IsSupersetOf(
          {"evaluations.jsonl", "summary.json", "report.html", "trajectory.tum", "defaults.tum"}));
  const auto summary = nlohmann::json::parse(readFile(path("out/summary.json")));
  EXPECT_LE(summary["evaluations"], 6);
  // Resumed from any line: the same bytes.
  const std::string journal = readFile(path("out/evaluations.jsonl"));
  file("cut/evaluations.jsonl", journal.substr(0, journal.size() / 2));
  const CommandResult again = run({"tune", session, "--threads", "1", "--out", path("cut")});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(readFile(path("cut/evaluations.jsonl")), journal);
  EXPECT_EQ(readFile(path("cut/summary.json")), readFile(path("out/summary.json")));
}

TEST_F(Tune, DoesNotGoOnWithTheJournalOfAnotherSession) {
  file("out/evaluations.jsonl", "{\"session\":\"0\"}\n");
  const CommandResult result = run({"tune", smallSession(), "--out", path("out")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("evaluations.jsonl: belongs to another session"));
  EXPECT_EQ(readFile(path("out/evaluations.jsonl")), "{\"session\":\"0\"}\n");
}

TEST_F(Tune, ADamagedJournalIsNamedWithItsLine) {
  file("out/evaluations.jsonl", "what is this\n");
  const CommandResult result = run({"tune", smallSession(), "--out", path("out")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("evaluations.jsonl:1: not a line of a tuning session"));
}

TEST_F(Tune, ASuiteGivesTheSameWithThreadsAndRanks) {
  const std::string suite = file(
      "suite.yaml",
      "bench: ekf\n"
      "factors: [{name: ekf.gyro.noise_rad_sqrt_s, values: [0.0005, 0.008]}]\n"
      "recordings: [{log: " +
          shipped("datasets/husky_gnss/test1.bag") +
          "}]\n"
          "block_s: 20\n"
          "objectives: [{measure: hidden_outage, length_s: 15}]\n"
          "seeds: {count: 2}\n");
  const CommandResult threads = run({"bench", "suite", suite, "--out", path("threads")});
  ASSERT_EQ(threads.exit_code, 0) << threads.err;
  std::vector<std::string> command{
      "/usr/bin/env", "mpirun", "--allow-run-as-root", "--oversubscribe", "-n", "2"};
  for (const std::string& word : commandLine({"bench", "suite", suite, "--out", path("ranks")})) {
    command.push_back(word);
  }
  const CommandResult ranks = runCommand(command, path(""));
  ASSERT_EQ(ranks.exit_code, 0) << ranks.err;
  EXPECT_THAT(ranks.out, HasSubstr("4 runs, 0 failed"));
  EXPECT_THAT(ranks.out, HasSubstr("with 2 MPI ranks"));
  const std::string drive = "/runs/noise_rad_sqrt_s_0.008/1-test1.bag-seed-2/trajectory.tum";
  for (const std::string& name : {std::string("/summary.json"), drive}) {
    EXPECT_EQ(readFile(path("threads" + name)), readFile(path("ranks" + name))) << name;
  }
}

TEST_F(Tune, CalibrateRefusesByNameWhatTheRecordingDoesNotShow) {
  // 61 s of a Jackal without GNSS is not shipped; the Husky has GNSS but no laser.
  const CommandResult result =
      run({"calibrate", "mount", shipped("datasets/husky_gnss/test1.bag"), "--out", path("out")});
  EXPECT_THAT(result.out, HasSubstr("not observable here: no laser scans in the recording"));
  const auto summary = nlohmann::json::parse(readFile(path("out/summary.json")));
  EXPECT_EQ(summary["quantities"]["laser yaw"]["unobserved"], "no laser scans in the recording");
}

TEST_F(Tune, CalibrateSaysWhatItNeeds) {
  const std::string log = shipped("datasets/husky_gnss/test1.bag");
  const CommandResult no_track = run({"calibrate", "odometry", log, "--out", path("out")});
  EXPECT_EQ(no_track.exit_code, 2);
  EXPECT_THAT(no_track.err, HasSubstr("--track is required"));
  const CommandResult no_kind = run({"calibrate"});
  EXPECT_EQ(no_kind.exit_code, 2);
  const CommandResult gone = run({"calibrate", "offsets", path("gone.bag"), "--out", path("out")});
  EXPECT_EQ(gone.exit_code, 3);
  EXPECT_THAT(gone.err, HasSubstr("gone.bag"));
  expectNoOutput("out");
}

}  // namespace
}  // namespace vestibule::test
