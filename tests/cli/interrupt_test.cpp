// A run that is stopped half-way leaves nothing under a final name, and spoils no older result.

#include <signal.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "cli_fixture.hpp"

namespace vestibule::test {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

class Interrupted : public Cli {
 protected:
  /// The farm round takes several seconds: it is running when its first events are on the way.
  void startMission() {
    mission_ = std::make_unique<ChildProcess>(
        commandLine(
            {"mission",
             shipped("config/missions/farm_feeding.yaml"),
             "--world",
             shipped(kFarmWorld),
             "--out",
             path("out")}),
        folder_.path());
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(2);
    while (mission_->running() && !eventsStarted()) {
      ASSERT_LT(std::chrono::steady_clock::now(), deadline) << "the mission does not start";
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    ASSERT_TRUE(mission_->running()) << mission_->wait().err;
  }

  bool eventsStarted() const {
    if (!fs::exists(path("out"))) return false;
    for (const auto& entry : fs::directory_iterator(path("out"))) {
      const fs::path events = entry.path() / "events.jsonl";
      if (entry.path().filename().string().rfind(".partial-", 0) == 0 && fs::exists(events) &&
          fs::file_size(events) > 0) {
        return true;
      }
    }
    return false;
  }

  std::unique_ptr<ChildProcess> mission_;
};

TEST_F(Interrupted, ByControlCLeavesNothing) {
  startMission();
  mission_->sendSignal(SIGINT);
  const CommandResult result = mission_->wait();
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_THAT(result.err, HasSubstr("vestibule: interrupted; nothing was written"));
  expectNoOutput("out");
  EXPECT_FALSE(fs::exists(path("out"))) << "the run made this folder and left something in it";
}

TEST_F(Interrupted, ByTerminationLeavesNothing) {
  startMission();
  mission_->sendSignal(SIGTERM);
  EXPECT_EQ(mission_->wait().exit_code, 1);
  EXPECT_FALSE(fs::exists(path("out")));
}

TEST_F(Interrupted, ByKillLeavesNothingUnderAFinalName) {
  startMission();
  mission_->sendSignal(SIGKILL);
  EXPECT_EQ(mission_->wait().signal, SIGKILL);
  expectNoOutput("out");
}

TEST_F(Interrupted, KeepsTheOlderResult) {
  file("out/trajectory.tum", "older trajectory\n");
  file("out/summary.json", "{}\n");
  startMission();
  mission_->sendSignal(SIGINT);
  EXPECT_EQ(mission_->wait().exit_code, 1);
  EXPECT_THAT(finalFiles(path("out")), ElementsAre("summary.json", "trajectory.tum"));
  EXPECT_EQ(readFile(path("out/trajectory.tum")), "older trajectory\n");
}

}  // namespace
}  // namespace vestibule::test
