// Bad input: the message names file, place, value and remedy, the exit code tells usage (2) from
// data (3), and nothing is left under a final name.

#include "cli_fixture.hpp"

namespace vestibule::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr int kBadUsage = 2;
constexpr int kBadInput = 3;

struct BadRecording {
  std::string name;      ///< of the test
  std::string file;      ///< its ending decides the kind
  std::string bytes;     ///< content; empty = see `cut_from`
  std::string cut_from;  ///< a good recording, of which the first 60 % are taken
  std::string message;
};

class BadRecordings : public Cli, public testing::WithParamInterface<BadRecording> {
 protected:
  std::string recording() const {
    const BadRecording& bad = GetParam();
    if (bad.cut_from.empty()) return file(bad.file, bad.bytes);
    const std::string good = readFile(bad.cut_from);
    return file(bad.file, good.substr(0, good.size() * 6 / 10));
  }
};

TEST_P(BadRecordings, AreRefusedByEveryCommand) {
  const std::string log = recording();
  const std::string out = path("out");
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"info", log},
        {"localize", log, "--map", roomMap(), "--init", "1,1,0", "--out", out},
        {"fuse", log, "--out", out},
        {"replay", log, "--site", shipped("config/sites/farm.yaml"), "--out", out},
        {"map", log, "--known-poses", "--out", out}}) {
    SCOPED_TRACE(command.front());
    const CommandResult result = run(command);
    EXPECT_EQ(result.exit_code, kBadInput) << result.err;
    EXPECT_THAT(
        result.err,
        AllOf(HasSubstr("vestibule: "), HasSubstr(GetParam().file), HasSubstr(GetParam().message)));
    EXPECT_EQ(lines(result.err).size(), 1U) << result.err;
    EXPECT_EQ(result.out, "");
    expectNoOutput("out");
  }
}

/// Bytes that are no format's.
std::string garbage() {
  std::string bytes;
  unsigned state = 12345;
  for (int i = 0; i < 4000; ++i) {
    state = state * 1103515245U + 12345U;
    bytes += static_cast<char>(state >> 16U);
  }
  return bytes;
}

constexpr const char* kGoodLines =
    "FLASER 3 1.0 2.0 3.0 0 0 0 0 0 0 10.0 robot 0.0\n"
    "FLASER 3 1.0 2.0 3.0 0.1 0 0 0.1 0 0 10.2 robot 0.2\n";

INSTANTIATE_TEST_SUITE_P(
    AllFormats,
    BadRecordings,
    testing::Values(
        BadRecording{"EmptyRawlog", "log.rawlog", "", "", "the file is empty"},
        BadRecording{"EmptyCarmen", "robot.log", "", "", "the file is empty"},
        BadRecording{"EmptyBag", "drive.bag", "", "", "the file is empty"},
        BadRecording{"GarbageRawlog", "log.rawlog", garbage(), "", "not an MRPT rawlog"},
        BadRecording{"GarbageCarmen", "robot.log", garbage(), "", "not a CARMEN log"},
        BadRecording{"GarbageBag", "drive.bag", garbage(), "", "not a ROS 1 bag"},
        BadRecording{
            "TruncatedRawlog",
            "log.rawlog",
            "",
            std::string(kMrptDatasets) + "localization_demo.rawlog",
            "cut off"},
        BadRecording{
            "TruncatedBag", "drive.bag", "", shipped("datasets/husky_gnss/test1.bag"), "cut off"},
        BadRecording{
            "TruncatedCarmen",
            "robot.log",
            std::string(kGoodLines) + "FLASER 3 1.0 2.0",
            "",
            "robot.log:3: FLASER line has 4 words"},
        BadRecording{
            "NanInCarmen",
            "robot.log",
            std::string(kGoodLines) + "ODOM 0.2 nan 0 0 0 0 10.4 robot 0.4\n",
            "",
            "robot.log:3: word 3 of the ODOM line is 'nan'"}),
    [](const auto& instance) { return instance.param.name; });

TEST_F(Cli, MissingRecording) {
  const std::string log = path("gone.rawlog");
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"info", log},
        {"localize", log, "--map", roomMap(), "--out", path("out")},
        {"fuse", log, "--out", path("out")},
        {"map", log, "--known-poses", "--out", path("out")}}) {
    SCOPED_TRACE(command.front());
    const CommandResult result = run(command);
    EXPECT_EQ(result.exit_code, kBadInput);
    EXPECT_THAT(result.err, HasSubstr(log + ": no such file; check the path"));
    expectNoOutput("out");
  }
}

TEST_F(Cli, NanInCsv) {
  const std::string csv = file("drive.csv", "t,left,right\n0,1,1\n1,1,1\n2,nan,1\n");
  const std::string mapping =
      file("mapping.yaml", "time: {column: t}\nwheels: {left: left, right: right, track_m: 0.5}\n");
  const CommandResult result = run({"fuse", csv, "--csv-mapping", mapping, "--out", path("out")});
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(
      result.err,
      AllOf(HasSubstr("drive.csv:4: column 'left' is 'nan'"), HasSubstr("optional: true")));
  expectNoOutput("out");
}

TEST_F(Cli, CsvWithoutMapping) {
  const std::string csv = file("drive.csv", "t,left,right\n0,1,1\n");
  const CommandResult result = run({"fuse", csv, "--out", path("out")});
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.err, HasSubstr("drive.csv:1: no column mapping fits the header"));
  expectNoOutput("out");
}

class BadMap : public Cli {
 protected:
  CommandResult localizeIn(const std::string& map) const {
    const std::string log = std::string(kMrptDatasets) + "localization_demo.rawlog";
    return run({"localize", log, "--map", map, "--out", path("out")});
  }
};

TEST_F(BadMap, WithoutResolution) {
  const CommandResult result = localizeIn(file(
      "map.yaml",
      "image: room.pgm\norigin: [0, 0, 0]\nnegate: 0\n"
      "occupied_thresh: 0.65\nfree_thresh: 0.196\n"));
  EXPECT_EQ(result.exit_code, kBadUsage);
  EXPECT_THAT(result.err, HasSubstr("map.yaml:1: resolution: missing (required)"));
  expectNoOutput("out");
}

TEST_F(BadMap, WithMissingImage) {
  const CommandResult result = localizeIn(file(
      "map.yaml",
      "image: gone.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n"
      "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"));
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(
      result.err, AllOf(HasSubstr("map.yaml:1: image: "), HasSubstr("gone.pgm: no such file")));
  expectNoOutput("out");
}

TEST_F(BadMap, Missing) {
  const CommandResult result = localizeIn(path("gone.yaml"));
  EXPECT_EQ(result.exit_code, kBadUsage);
  EXPECT_THAT(result.err, HasSubstr("gone.yaml: cannot be read"));
  expectNoOutput("out");
}

TEST_F(Cli, UnknownConfigKeyIsNamedWithTheNearestOne) {
  const std::string config = file("mine.yaml", "amcl:\n  kld:\n    min_particels: 300\n");
  const std::string log = shipped("datasets/husky_gnss/test1.bag");
  const std::string mission = shortMission();
  const std::string out = path("out");
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"fuse", log, "--config", config, "--out", out},
        {"localize", log, "--map", roomMap(), "--config", config, "--out", out},
        {"map", log, "--known-poses", "--config", config, "--out", out},
        {"mission", mission, "--world", shipped(kFarmWorld), "--config", config, "--out", out}}) {
    SCOPED_TRACE(command.front());
    const CommandResult result = run(command);
    EXPECT_EQ(result.exit_code, kBadUsage);
    EXPECT_THAT(
        result.err,
        HasSubstr("mine.yaml:3: amcl.kld.min_particels: unknown key (did you mean "
                  "min_particles?)"));
    expectNoOutput("out");
  }
}

TEST_F(Cli, EveryProblemOfAConfigIsListed) {
  const std::string config =
      file("mine.yaml", "ekf:\n  gate_probability: 1.5\n  wheels:\n    scale_sigma: fast\n");
  const CommandResult result = run(
      {"fuse", shipped("datasets/husky_gnss/test1.bag"), "--config", config, "--out", path("out")});
  EXPECT_EQ(result.exit_code, kBadUsage);
  EXPECT_EQ(lines(result.err).size(), 2U) << result.err;
  EXPECT_THAT(
      result.err,
      AllOf(
          HasSubstr("mine.yaml:2: ekf.gate_probability = 1.5: must be in (0, 1)"),
          HasSubstr("mine.yaml:4: ekf.wheels.scale_sigma: must be a number, is 'fast'")));
  expectNoOutput("out");
}

class BadMission : public Cli {
 protected:
  CommandResult driveTo(const std::string& waypoint) const {
    return run(
        {"mission", missionTo(waypoint), "--world", shipped(kFarmWorld), "--out", path("out")});
  }
};

TEST_F(BadMission, LatitudeOutOfRange) {
  const CommandResult result = driveTo("[96.83, -2.405, 50, 0]");
  EXPECT_EQ(result.exit_code, kBadUsage);
  EXPECT_THAT(
      result.err,
      AllOf(
          HasSubstr("mission.yaml:7"),
          HasSubstr("goal: latitude 96.83 deg is out of range [-90, 90]")));
  expectNoOutput("out");
}

TEST_F(BadMission, LatitudeSwappedWithLongitude) {
  const CommandResult result = driveTo("[-2.405, 36.83, 50, 0]");
  EXPECT_EQ(result.exit_code, kBadUsage);
  EXPECT_THAT(
      result.err,
      AllOf(
          HasSubstr("mission.yaml:7"),
          HasSubstr("latitude and longitude look swapped: did you mean [36.83, -2.405")));
  expectNoOutput("out");
}

TEST_F(BadMission, WaypointInsideAWall) {
  const CommandResult result = driveTo("{x: 0.1, y: 3.0}");
  EXPECT_EQ(result.exit_code, kBadUsage);
  EXPECT_THAT(
      result.err,
      AllOf(
          HasSubstr("mission.yaml:7: waypoint 'goal' of path 'there' at (0.10, 3.00) m"),
          HasSubstr("move it by")));
  expectNoOutput("out");
}

TEST_F(BadMission, MissingWorld) {
  const CommandResult result = run(
      {"mission",
       missionTo("{x: -20, y: -2}"),
       "--world",
       path("gone.yaml"),
       "--out",
       path("out")});
  EXPECT_EQ(result.exit_code, kBadUsage);
  EXPECT_THAT(result.err, HasSubstr("gone.yaml: cannot be read"));
  expectNoOutput("out");
}

TEST_F(Cli, OutputFolderThatIsAFile) {
  const CommandResult result =
      run({"fuse", shipped("datasets/husky_gnss/test1.bag"), "--out", file("taken", "something")});
  EXPECT_EQ(result.exit_code, kBadUsage);
  EXPECT_THAT(
      result.err,
      AllOf(HasSubstr("taken: cannot write results there"), HasSubstr("another --out folder")));
  EXPECT_EQ(readFile(path("taken")), "something");
}

TEST_F(Cli, WrongSensorsAreNamed) {
  const CommandResult result = run(
      {"localize",
       shipped("datasets/husky_gnss/test1.bag"),
       "--map",
       roomMap(),
       "--out",
       path("out")});
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.err, HasSubstr("test1.bag: no laser scan in it"));
  expectNoOutput("out");
}

}  // namespace
}  // namespace vestibule::test
