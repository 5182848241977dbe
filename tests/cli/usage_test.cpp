// The command line itself: help, and wrong usage (exit code 2).

#include <map>

#include "cli_fixture.hpp"

namespace vestibule::test {
namespace {

using testing::HasSubstr;

constexpr int kBadUsage = 2;

TEST_F(Cli, HelpListsEveryCommand) {
  const CommandResult result = run({"--help"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.err, "");
  for (const char* command :
       {"demo", "info", "localize", "fuse", "map", "mission", "replay", "sim", "eval"}) {
    EXPECT_THAT(result.out, HasSubstr(std::string("\n  ") + command + " "));
  }
  EXPECT_THAT(result.out, HasSubstr("Exit codes"));
}

TEST_F(Cli, HelpOfEachCommandExplainsItsOptions) {
  const std::map<std::string, std::vector<std::string>> options{
      {"demo", {"--out"}},
      {"info", {"LOG", "--json"}},
      {"localize", {"LOG", "--map", "--init", "--global", "--config", "--ref", "--out"}},
      {"fuse", {"LOG", "--config", "--csv-mapping", "--ref", "--out"}},
      {"map",
       {"LOG",
        "--known-poses",
        "--config",
        "--gmapping-params",
        "--particles",
        "--extend",
        "--init",
        "--cut",
        "--resume",
        "--georeference",
        "--preview",
        "--out"}},
      {"mission", {"MISSION", "--world", "--seed", "--config", "--record", "--out"}},
      {"replay", {"LOG", "--site", "--init", "--config", "--csv-mapping", "--ref", "--out"}},
      {"sim", {"--scenario", "--list", "--seed", "--record", "--out"}},
      {"eval",
       {"EST",
        "--ref",
        "--relations",
        "--odometry",
        "--max-dt",
        "--interpolate",
        "--step-m",
        "--step-s",
        "--json"}}};
  for (const auto& [command, names] : options) {
    SCOPED_TRACE(command);
    const CommandResult result = run({command, "--help"});
    EXPECT_EQ(result.exit_code, 0);
    EXPECT_EQ(result.err, "");
    for (const std::string& name : names) EXPECT_THAT(result.out, HasSubstr(name));
  }
}

TEST_F(Cli, CommandIsRequired) {
  const CommandResult result = run({});
  EXPECT_EQ(result.exit_code, kBadUsage);
  EXPECT_THAT(result.err, HasSubstr("subcommand"));
  EXPECT_EQ(result.out, "");
}

TEST_F(Cli, UnknownCommand) {
  const CommandResult result = run({"localise", path("log.rawlog"), "--out", path("out")});
  EXPECT_EQ(result.exit_code, kBadUsage);
  EXPECT_THAT(result.err, HasSubstr("--help"));
  EXPECT_EQ(result.out, "");
  expectNoOutput("out");
}

TEST_F(Cli, UnknownOption) {
  const CommandResult result = run({"info", path("log.rawlog"), "--jason"});
  EXPECT_EQ(result.exit_code, kBadUsage);
  EXPECT_THAT(result.err, HasSubstr("--jason"));
}

TEST_F(Cli, OutIsRequired) {
  const std::string log = shipped("datasets/husky_gnss/test1.bag");
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"fuse", log},
        {"localize", log, "--map", roomMap()},
        {"map", log, "--known-poses"},
        {"mission", shortMission(), "--world", shipped(kFarmWorld)}}) {
    SCOPED_TRACE(command.front());
    const CommandResult result = run(command);
    EXPECT_EQ(result.exit_code, kBadUsage);
    EXPECT_THAT(result.err, HasSubstr("--out is required"));
  }
}

TEST_F(Cli, WrongStartPose) {
  const std::string log = std::string(kMrptDatasets) + "localization_demo.rawlog";
  for (const char* init : {"1,2", "1,2,3,4", "a,b,c", "1,2,nan", "1;2;3"}) {
    SCOPED_TRACE(init);
    const CommandResult result =
        run({"localize", log, "--map", roomMap(), "--init", init, "--out", path("out")});
    EXPECT_EQ(result.exit_code, kBadUsage);
    EXPECT_THAT(result.err, HasSubstr(std::string("--init ") + init + ": must be x_m,y_m,yaw_rad"));
    expectNoOutput("out");
  }
}

TEST_F(Cli, StartPoseAndGlobalExcludeEachOther) {
  const CommandResult result = run(
      {"localize",
       path("log.rawlog"),
       "--map",
       roomMap(),
       "--init",
       "1,1,0",
       "--global",
       "--out",
       path("out")});
  EXPECT_EQ(result.exit_code, kBadUsage);
  EXPECT_THAT(result.err, HasSubstr("excludes"));
  expectNoOutput("out");
}

TEST_F(Cli, SeedMustBeANumber) {
  const CommandResult result = run(
      {"mission",
       shortMission(),
       "--world",
       shipped(kFarmWorld),
       "--seed",
       "lucky",
       "--out",
       path("out")});
  EXPECT_EQ(result.exit_code, kBadUsage);
  EXPECT_THAT(result.err, HasSubstr("--seed"));
  expectNoOutput("out");
}

}  // namespace
}  // namespace vestibule::test
