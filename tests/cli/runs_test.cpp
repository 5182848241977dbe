// Runs that succeed: the files each leaves, that they say what they should, and that a second run
// writes the same bytes.

#include <cmath>
#include <filesystem>
#include <sstream>

#include "cli_fixture.hpp"
#include "room_log.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/io/rawlog_writer.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/io/trajectory.hpp"
#include "vestibule/pipeline/config.hpp"

namespace vestibule::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::IsSupersetOf;

class Runs : public Cli {
 protected:
  /// Runs the command into `out`, expects success and a complete, well-formed set of files.
  void runInto(const std::string& out, std::vector<std::string> command) const {
    const std::string name = command.front();
    command.insert(command.end(), {"--out", path(out)});
    const CommandResult result = run(command);
    ASSERT_EQ(result.exit_code, 0) << result.err << result.out;
    EXPECT_EQ(result.err, "") << "quiet when standard error is no terminal";
    EXPECT_THAT(result.out, HasSubstr("report: " + path(out) + "/report.html"));
    expectWellFormed(out, name);
  }

  void expectWellFormed(const std::string& out, const std::string& command) const {
    ASSERT_THAT(
        finalFiles(path(out)),
        IsSupersetOf(
            {"config.resolved.yaml",
             "events.jsonl",
             "map.png",
             "report.html",
             "summary.json",
             "trajectory.tum"}));

    EXPECT_FALSE(io::readTum(path(out + "/trajectory.tum")).empty());

    const json summary = json::parse(readFile(path(out + "/summary.json")));
    EXPECT_EQ(summary.at("schema"), "vestibule.summary");
    EXPECT_EQ(summary.at("schema_version"), 1);
    EXPECT_EQ(summary.at("command"), command);
    EXPECT_TRUE(summary.at("seed").is_number_unsigned());

    std::size_t number = 0;
    for (const std::string& line : lines(readFile(path(out + "/events.jsonl")))) {
      ++number;
      const json event = json::parse(line, nullptr, false);
      ASSERT_TRUE(event.is_object()) << "events.jsonl:" << number << ": " << line;
      EXPECT_TRUE(event.contains("t") && event.contains("type")) << line;
    }

    const std::string resolved = readFile(path(out + "/config.resolved.yaml"));
    EXPECT_EQ(
        dumpParams(parseParams<pipeline::Config>(resolved, "config.resolved.yaml")), resolved);

    EXPECT_EQ(readFile(path(out + "/map.png")).substr(0, 8), "\x89PNG\r\n\x1a\n");

    const std::string report = readFile(path(out + "/report.html"));
    EXPECT_THAT(report.substr(0, 200), testing::ContainsRegex("<!(DOCTYPE|doctype) html>"));
    EXPECT_THAT(report, HasSubstr("data:image/png;base64,"));
    EXPECT_THAT(report, HasSubstr("</html>"));
    for (const char* outside : {"src=\"http", "href=\"http", "src=\"//"}) {
      EXPECT_THAT(report, testing::Not(HasSubstr(outside))) << "the report is self-contained";
    }
  }

  /// The report and timing.json tell how fast this run was; everything else repeats.
  void expectSameBytes(const std::string& a, const std::string& b) const {
    ASSERT_EQ(finalFiles(path(a)), finalFiles(path(b)));
    for (const std::string& name : finalFiles(path(a))) {
      if (name == "report.html" || name == "timing.json") continue;
      EXPECT_TRUE(readFile(path(a + "/" + name)) == readFile(path(b + "/" + name)))
          << name << " differs between two equal runs";
    }
  }

  void expectRepeats(const std::vector<std::string>& command) const {
    ASSERT_NO_FATAL_FAILURE(runInto("first", command));
    ASSERT_NO_FATAL_FAILURE(runInto("second", command));
    expectSameBytes("first", "second");
  }
};

TEST_F(Runs, GlobalLocalizationRepeats) {
  const std::string demo = std::string(kMrptDatasets) + "localization_demo";
  expectRepeats({"localize", demo + ".rawlog", "--map", demo + ".simplemap.gz"});
}

TEST_F(Runs, FuseRepeats) { expectRepeats({"fuse", shipped("datasets/husky_gnss/test1.bag")}); }

TEST_F(Runs, MissionRepeatsAndTheSeedMatters) {
  const std::vector<std::string> mission{
      "mission", shortMission(), "--world", shipped(kFarmWorld), "--record"};
  expectRepeats(mission);
  EXPECT_THAT(
      finalFiles(path("first")),
      IsSupersetOf({"inside.png", "odometry.tum", "recording.rawlog", "truth.tum"}));
  const json summary = json::parse(readFile(path("first/summary.json")));
  EXPECT_EQ(summary["done"], true) << summary.dump(2);
  EXPECT_EQ(summary["waypoints"].size(), 2U);

  auto other = mission;
  other.insert(other.end(), {"--seed", "2"});
  ASSERT_NO_FATAL_FAILURE(runInto("other", other));
  EXPECT_NE(readFile(path("first/trajectory.tum")), readFile(path("other/trajectory.tum")));

  // Nothing lands in the working folder: there are only the mission, the outputs and what the
  // three runs printed.
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    EXPECT_THAT(
        entry.path().filename().string(),
        testing::MatchesRegex("short.yaml|first|second|other|std(out|err)-[0-9]+"));
  }

  // The recording can be read again.
  const CommandResult info = run({"info", path("first/recording.rawlog"), "--json"});
  EXPECT_EQ(info.exit_code, 0) << info.err;
  const json contents = json::parse(info.out);
  EXPECT_EQ(contents["format"], "MRPT rawlog");
}

TEST_F(Runs, ReplayRepeats) {
  const std::string demo = std::string(kMrptDatasets) + "localization_demo";
  const std::string site = file(
      "site.yaml",
      "name: demo\n"
      "datum: [36.7, -4.4, 60]\n"
      "indoor_maps: [{name: floor, map: " +
          demo +
          ".simplemap.gz, T_map_grid: [0, 0, 0]}]\n"
          "buildings: [{name: floor, outline: [[-50, -50], [50, -50], [50, 50], [-50, 50]]}]\n");
  // A real robot inside a building; where it starts was found by `localize --global`.
  expectRepeats({"replay", demo + ".rawlog", "--site", site, "--init", "1.304,-10.395,-0.4644"});
  const json summary = json::parse(readFile(path("first/summary.json")));
  EXPECT_EQ(summary["final_mode"], "indoor") << summary.dump(2);
  EXPECT_GT(summary["share_in_mode"]["indoor"], 0.5);
}

TEST_F(Runs, TheResolvedConfigurationGivesTheSameRun) {
  const std::string log = shipped("datasets/husky_gnss/test1.bag");
  const std::string config = file("mine.yaml", "ekf:\n  gnss:\n    sigma_differential_m: 2.5\n");
  ASSERT_NO_FATAL_FAILURE(runInto("first", {"fuse", log, "--config", config}));
  ASSERT_NO_FATAL_FAILURE(
      runInto("second", {"fuse", log, "--config", path("first/config.resolved.yaml")}));
  expectSameBytes("first", "second");
}

class Room : public Runs {
 protected:
  void SetUp() override {
    file("corrected.log", drive_.carmenLog(true));
    file("raw.log", drive_.carmenLog(false));
    ASSERT_NO_FATAL_FAILURE(runInto("map", {"map", path("corrected.log"), "--known-poses"}));
  }

  RoomDrive drive_;
};

TEST_F(Room, MapThenLocalizeInIt) {
  const json map = json::parse(readFile(path("map/summary.json")));
  EXPECT_EQ(map["scans"], drive_.poses.size());
  // 9 x 7 m of room with a rim of 1 m
  EXPECT_NEAR(map["width_cells"].get<double>() * 0.05, 11.0, 0.5);
  EXPECT_NEAR(map["height_cells"].get<double>() * 0.05, 9.0, 0.5);

  const Pose2& start = drive_.poses.front();
  const std::string init =
      std::to_string(start.x) + "," + std::to_string(start.y) + "," + std::to_string(start.phi);
  ASSERT_NO_FATAL_FAILURE(
      runInto("loc", {"localize", path("raw.log"), "--map", path("map/map.yaml"), "--init", init}));

  // One line per scan in file order with the scan's own stamp, also where they run backwards.
  const io::Trajectory poses = io::readTum(path("loc/trajectory.tum"));
  ASSERT_EQ(poses.size(), drive_.poses.size());
  std::size_t backwards = 0;
  double worst_m = 0.0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(poses[i].stamp, drive_.stamps[i]) << "line " << i + 1;
    if (i > 0 && poses[i].stamp < poses[i - 1].stamp) ++backwards;
    worst_m = std::max(worst_m, distance(toPose2(poses[i].T), drive_.poses[i]));
  }
  EXPECT_EQ(backwards, 2U);
  // The odometry alone is 0.3 m off after the loop; cells are 0.05 m.
  EXPECT_LE(worst_m, 0.12);
}

TEST_F(Room, MapKeepsThePosesOfTheLog) {
  const io::Trajectory poses = io::readTum(path("map/trajectory.tum"));
  ASSERT_EQ(poses.size(), drive_.poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(poses[i].stamp, drive_.stamps[i]) << "line " << i + 1;
    EXPECT_LT(distance(toPose2(poses[i].T), drive_.poses[i]), 1e-5) << "line " << i + 1;
  }
}

/// FLASER lines of 181 beams with their odometry east of where it was.
std::string odometryMoved(const std::string& lines, double east_m) {
  std::istringstream in(lines);
  std::string moved;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    int column = 0;
    for (std::string word; words >> word; ++column) {
      const bool is_x = column == 2 + 181 || column == 2 + 181 + 3;
      moved += (column == 0 ? "" : " ") + (is_x ? std::to_string(std::stod(word) + east_m) : word);
    }
    moved += '\n';
  }
  return moved;
}

/// A robot that drives 2 m along an empty room of 8 x 5 m: seen from within, the room looks the
/// same turned by half a turn about its centre.
class EmptyRoom : public Runs {
 protected:
  static constexpr double kWidth_m = 8.0;
  static constexpr double kHeight_m = 5.0;
  static constexpr double kY_m = 1.5;

  void SetUp() override {
    std::string pixels;
    for (int row = 0; row < 100; ++row) {
      for (int column = 0; column < 160; ++column) {
        const bool wall = row < 1 || row > 98 || column < 1 || column > 158;
        pixels += wall ? '\0' : '\xfe';
      }
    }
    file("room.pgm", "P5\n160 100\n255\n" + pixels);
    file("room.yaml", "image: room.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n");
    std::string log;
    for (int i = 0; i <= 20; ++i) {
      const double x = 1.5 + 0.1 * i;
      log += "FLASER 181";
      for (int beam = 0; beam < 181; ++beam) {
        const double angle = degToRad(beam - 90.0);
        const double to_end = (kWidth_m - 0.05 - x) / std::max(std::cos(angle), 1e-9);
        const double to_side = (angle > 0.0 ? kHeight_m - 0.05 - kY_m : kY_m - 0.05) /
                               std::max(std::abs(std::sin(angle)), 1e-9);
        log += ' ' + std::to_string(std::min(to_end, to_side));
      }
      const std::string pose = ' ' + std::to_string(0.1 * i) + " 0 0";
      const std::string stamp = std::to_string(100.0 + 0.2 * i);
      log += pose + pose + ' ' + stamp + " host " + stamp + '\n';
    }
    file("drive.log", log);
  }
  [[nodiscard]] json summaryWith(std::vector<std::string> arguments) const {
    arguments.insert(
        arguments.begin(),
        {"localize",
         path("drive.log"),
         "--map",
         path("room.yaml"),
         "--global",
         "--out",
         path("g")});
    const CommandResult result = run(arguments);
    EXPECT_LE(result.exit_code, 1) << result.err;
    return json::parse(readFile(path("g/summary.json")));
  }
};

TEST_F(EmptyRoom, WhatIsKnownOfTheStartDecidesWhichWayItIs) {
  EXPECT_EQ(summaryWith({})["final_state"], "unsure");  // it looks the same both ways
  for (const std::vector<std::string>& there :
       {std::vector<std::string>{"--near", "1.5,1.5,0.5"},
        std::vector<std::string>{"--heading", "10,15"},
        std::vector<std::string>{"--zone", "0,0,3,2.5"}}) {
    const json s = summaryWith(there);
    EXPECT_EQ(s["final_state"], "sure") << there[0];
    EXPECT_NEAR(s["final_pose"][0].get<double>(), 3.5, 0.1) << there[0];
    EXPECT_NEAR(s["final_pose"][2].get<double>(), 0.0, 0.05) << there[0];
  }
  // The other way round, as told.
  EXPECT_NEAR(summaryWith({"--heading", "170,15"})["final_pose"][0].get<double>(), 4.5, 0.1);
}

TEST_F(EmptyRoom, FixesOfTheRecordingDecideWhereTheMapHasAGeoreference) {
  // GIVEN a carrier-phase fix with every scan
  const geo::TangentPlane plane({45.0, 7.0, 200.0});
  const Pose2 T_enu_map{100.0, 50.0, degToRad(40.0)};
  const std::string recording = path("gnss.rawlog");
  io::RawlogWriter writer(recording);
  const auto reader = io::openRecording(path("drive.log"), {});
  int scans = 0;
  while (const auto record = reader->next()) {
    writer.write(record->measurement, record->source);
    if (!std::holds_alternative<LaserScan>(record->measurement)) continue;
    const Point2 p = transform(T_enu_map, Point2{1.5 + 0.1 * scans++, kY_m});
    GnssFix fix;
    fix.stamp = stampOf(record->measurement);
    fix.type = GnssFixType::kRtkFixed;
    fix.position = plane.toGeodetic({p.x, p.y, 0.0});
    writer.write(fix, "GNSS");
  }
  writer.close();
  const std::string georeferenced = file(
      "geo.yaml",
      readFile(path("room.yaml")) +
          "georeference:\n  datum: [45, 7, 200]\n  T_map_grid: [100, 50, 40]\n");
  const auto summaryIn = [&](const std::string& map) {
    const CommandResult result =
        run({"localize", recording, "--map", map, "--global", "--out", path("g")});
    EXPECT_LE(result.exit_code, 1) << result.err;
    return json::parse(readFile(path("g/summary.json")));
  };

  // WHEN the map does not say where it lies
  const json without = summaryIn(path("room.yaml"));
  // THEN they are of no use, which is said
  EXPECT_EQ(without["final_state"], "unsure");
  EXPECT_THAT(without["notes"].dump(), HasSubstr("the map has no georeference: 21 fixes not used"));

  const json with = summaryIn(georeferenced);
  EXPECT_EQ(with["final_state"], "sure");
  EXPECT_NEAR(with["final_pose"][0].get<double>(), 3.5, 0.1);
  EXPECT_GT(with["geo"]["fixes_in_search"], 2);
  EXPECT_THAT(with["notes"].dump(), testing::Not(HasSubstr("georeference")));

  EXPECT_THAT(run({"info", georeferenced}).out, HasSubstr("yaw 40.000 deg"));
  ASSERT_EQ(run({"convert", georeferenced, path("again.yaml")}).exit_code, 0);
  EXPECT_EQ(
      json::parse(run({"info", path("again.yaml"), "--json"}).out)["georeference"],
      json::parse(run({"info", georeferenced, "--json"}).out)["georeference"]);
}

TEST_F(Room, AStartOutsideOfTheMapIsToldAndALeapOfTheOdometryLeftOut) {
  const std::string log = drive_.carmenLog(false);
  // From half way on the odometry counts from elsewhere.
  const std::size_t half = log.find("FLASER", log.size() / 2);
  file("away.log", log.substr(0, half) + odometryMoved(log.substr(half), 5000.0));
  const Pose2& start = drive_.poses.front();
  const std::string init =
      std::to_string(start.x) + "," + std::to_string(start.y) + "," + std::to_string(start.phi);
  ASSERT_NO_FATAL_FAILURE(runInto(
      "leap", {"localize", path("away.log"), "--map", path("map/map.yaml"), "--init", init}));
  EXPECT_THAT(readFile(path("leap/events.jsonl")), HasSubstr("leaps farther than any robot"));
  EXPECT_GT(json::parse(readFile(path("leap/summary.json")))["trusted_share"].get<double>(), 0.95);

  ASSERT_NO_FATAL_FAILURE(runInto(
      "out", {"localize", path("raw.log"), "--map", path("map/map.yaml"), "--init", "-40,3,0"}));
  EXPECT_THAT(readFile(path("out/events.jsonl")), HasSubstr("start pose is outside of the map"));
  const CommandResult far = run(
      {"localize",
       path("raw.log"),
       "--map",
       path("map/map.yaml"),
       "--init",
       "1e15,3,0",
       "--out",
       path("far")});
  EXPECT_EQ(far.exit_code, 2);
  EXPECT_THAT(far.err, HasSubstr("m outside of the map"));
}

TEST_F(Room, ALostRobotFailsItsPurpose) {
  // GIVEN a map of another place: the scans cannot fit
  const CommandResult result = run(
      {"localize", path("raw.log"), "--map", roomMap(), "--init", "1,1,0", "--out", path("lost")});
  // THEN the run is complete and says so
  EXPECT_EQ(result.exit_code, 1) << result.out;
  EXPECT_THAT(result.out, HasSubstr("LOST"));
  expectWellFormed("lost", "localize");
}

TEST_F(Cli, InfoTellsWhatIsInARecording) {
  const std::string log = file("raw.log", RoomDrive().carmenLog(false));
  const CommandResult table = run({"info", log});
  EXPECT_EQ(table.exit_code, 0) << table.err;
  EXPECT_THAT(
      table.out, testing::AllOf(HasSubstr("CARMEN log"), HasSubstr("FLASER"), HasSubstr("140")));
  EXPECT_THAT(table.out, testing::ContainsRegex("backward"));

  const CommandResult as_json = run({"info", log, "--json"});
  EXPECT_EQ(as_json.exit_code, 0);
  const json info = json::parse(as_json.out);
  EXPECT_EQ(info["format"], "CARMEN log");
  EXPECT_TRUE(info.contains("schema"));
}

}  // namespace
}  // namespace vestibule::test
