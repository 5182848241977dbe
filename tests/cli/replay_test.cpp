// vestibule replay on drives of the simulator, where the truth is known.

#include <sstream>

#include "cli_fixture.hpp"

namespace vestibule::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Replay : public Cli {
 protected:
  /// Records a scenario into the folder `scenario` and replays it into `scenario/replay`, as the
  /// scenario's own summary says.
  json replayed(const std::string& scenario, int expected_exit_code) const {
    const CommandResult drive = run({"sim", "--scenario", scenario, "--out", path(scenario)});
    EXPECT_EQ(drive.exit_code, 0) << drive.err;
    const std::string folder = path(scenario) + "/";
    const json summary = json::parse(readFile(folder + "summary.json"));
    std::vector<std::string> words;
    std::istringstream text(summary.at("replay").get<std::string>());
    for (std::string word; text >> word;) {
      const bool is_file =
          word.find(".") != std::string::npos && word.find(",") == std::string::npos;
      words.push_back(is_file ? folder + word : word);
    }
    EXPECT_EQ(words.front(), "vestibule");
    words.erase(words.begin());
    words.insert(words.end(), {"--out", folder + "replay"});
    const CommandResult result = run(words);
    EXPECT_EQ(result.exit_code, expected_exit_code) << result.err << result.out;
    return json::parse(readFile(folder + "replay/summary.json"));
  }
};

TEST_F(Replay, GoesThroughTheDoorAndBack) {
  const json summary = replayed("straight_door", 0);
  EXPECT_EQ(summary["mode_switches"], 2) << "in and out again";
  EXPECT_EQ(summary["final_mode"], "outdoor");
  EXPECT_LT(summary["reference"]["translation_m"]["max"], 0.3);
  EXPECT_LT(summary["correction_step_100ms"]["position_m"], 0.05);
  EXPECT_LT(summary["correction_step_100ms"]["yaw_deg"], 0.5);
}

TEST_F(Replay, IsAsWrongAsTheSurveyItIsTold) {
  const json right = replayed("straight_door", 0);
  const json wrong = replayed("wrong_georeference", 0);
  EXPECT_GT(
      wrong["reference"]["translation_m"]["max"],
      right["reference"]["translation_m"]["max"].get<double>() + 0.4);
}

TEST_F(Replay, SaysThatItNeverKnewWhereItWas) {
  const json summary = replayed("office_global", 1);
  EXPECT_TRUE(summary["ready_after_s"].is_null());
  EXPECT_THAT(summary["waiting_for"].get<std::string>(), HasSubstr("yaw not observable yet"))
      << "the few fixes that come through the windows never tell the heading";
}

TEST_F(Replay, SaysWhatIsWrong) {
  const CommandResult no_site = run(
      {"replay",
       shipped("datasets/husky_gnss/test1.bag"),
       "--site",
       path("nowhere.yaml"),
       "--out",
       path("out")});
  EXPECT_EQ(no_site.exit_code, 2);
  EXPECT_THAT(no_site.err, HasSubstr("nowhere.yaml"));
  expectNoOutput("out");
}

}  // namespace
}  // namespace vestibule::test
