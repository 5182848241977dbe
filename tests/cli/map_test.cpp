// vestibule map without known poses: from a drive to a map, after a kill, over two drives.

#include <signal.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "cli_fixture.hpp"
#include "room_log.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/io/rawlog_writer.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/io/simple_map.hpp"
#include "vestibule/io/trajectory.hpp"

namespace vestibule::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

class MapDrive : public Cli {
 protected:
  void SetUp() override { file("raw.log", drive_.carmenLog(false)); }

  void map(const std::string& out, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments{"map", path("raw.log"), "--out", path(out)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const CommandResult result = run(arguments);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.err, "");
  }

  [[nodiscard]] json summary(const std::string& out) const {
    return json::parse(readFile(path(out + "/summary.json")));
  }

  /// How many cells of sessions.pgm have each of the values 0 to 3.
  [[nodiscard]] std::array<int, 4> layer(const std::string& out) const {
    const std::string image = readFile(path(out + "/sessions.pgm"));
    std::istringstream in(image);
    std::string magic;
    std::size_t width = 0, height = 0, largest = 0;
    in >> magic >> width >> height >> largest;
    EXPECT_EQ(magic, "P5");
    EXPECT_EQ(largest, 255U);  // up to eight sessions
    const std::string pixels = image.substr(static_cast<std::size_t>(in.tellg()) + 1);
    EXPECT_EQ(pixels.size(), width * height);
    const grid::OccupancyMap map = io::loadMap(path(out + "/map.yaml"));
    EXPECT_EQ(map.width(), static_cast<int>(width));
    EXPECT_EQ(map.height(), static_cast<int>(height));
    std::array<int, 4> counts{};
    for (const char pixel : pixels) ++counts.at(static_cast<std::size_t>(pixel));
    EXPECT_EQ(static_cast<std::size_t>(counts[0]), map.count(grid::Cell::kUnknown));
    return counts;
  }

  void expectSameMaps(const std::string& a, const std::string& b) const {
    for (const char* name :
         {"map.pgm", "map.yaml", "trajectory.tum", "graph.g2o", "summary.json"}) {
      EXPECT_EQ(readFile(path(a + "/" + name)), readFile(path(b + "/" + name))) << name;
    }
  }

  RoomDrive drive_;
};

TEST_F(MapDrive, MakesAMapThatOthersCanRead) {
  ASSERT_NO_FATAL_FAILURE(map("out", {"--particles", "5", "--preview", "50"}));
  // THEN there is a pose for every scan with its own stamp, right to a fraction of a cell
  const io::Trajectory poses = io::readTum(path("out/trajectory.tum"));
  ASSERT_EQ(poses.size(), drive_.poses.size());
  double worst_m = 0.0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(poses[i].stamp, drive_.stamps[i]) << "line " << i + 1;
    const Pose2 truth = between(drive_.poses.front(), drive_.poses[i]);
    worst_m =
        std::max(worst_m, distance(between(toPose2(poses.front().T), toPose2(poses[i].T)), truth));
  }
  EXPECT_LT(worst_m, 0.05);
  // AND the room of 9 x 7 m in both kinds of map
  const grid::OccupancyMap grid = io::loadMap(path("out/map.yaml"));
  EXPECT_GT(static_cast<double>(grid.count(grid::Cell::kFree)) * 0.0025, 50.0);
  EXPECT_GT(grid.count(grid::Cell::kOccupied), 400U);
  EXPECT_EQ(
      io::readSimpleMap(path("out/map.simplemap")).size(),
      summary("out")["scans_used"].get<std::size_t>());
  EXPECT_THAT(readFile(path("out/graph.g2o")), HasSubstr("VERTEX_SE2 1 "));
  EXPECT_THAT(readFile(path("out/report.html")), HasSubstr("Effective particles"));
  EXPECT_EQ(summary("out")["particles"], 5);
  EXPECT_GT(summary("out")["held_out"]["matched_share"], 0.9);
  EXPECT_TRUE(fs::exists(path("out/preview.png")));
  EXPECT_FALSE(fs::exists(path("out/map.journal")));
}

TEST_F(MapDrive, KilledAndResumedItGivesTheSame) {
  ASSERT_NO_FATAL_FAILURE(map("whole"));
  // GIVEN a run that is killed once it has written some updates
  for (const std::uintmax_t wanted : {2'000U, 9'000U}) {
    SCOPED_TRACE(wanted);
    const fs::path journal = path("killed/map.journal");
    {
      ChildProcess process(
          commandLine({"map", path("raw.log"), "--out", path("killed")}), folder_.path());
      std::error_code error;
      while (process.running() &&
             !(fs::exists(journal) && fs::file_size(journal, error) > wanted)) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
      process.sendSignal(SIGKILL);
      (void)process.wait();
    }
    // WHEN it goes on
    ASSERT_NO_FATAL_FAILURE(map("killed", {"--resume"}));
    // THEN the result is that of the run that was left alone
    expectSameMaps("whole", "killed");
    EXPECT_FALSE(fs::exists(journal));
    fs::remove_all(path("killed"));
  }
}

TEST_F(MapDrive, ResumeRefusesTheJournalOfAnotherRun) {
  ChildProcess process(commandLine({"map", path("raw.log"), "--out", path("out")}), folder_.path());
  // Until it says which run it is of.
  std::error_code absent;
  while (process.running() && (!fs::exists(path("out/map.journal")) ||
                               fs::file_size(path("out/map.journal"), absent) == 0)) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  process.sendSignal(SIGKILL);
  (void)process.wait();
  const CommandResult result =
      run({"map", path("raw.log"), "--particles", "3", "--resume", "--out", path("out")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("map.journal: is of a run with another recording"));
}

TEST_F(MapDrive, ASecondDriveIsAddedAndCutOutAgain) {
  ASSERT_NO_FATAL_FAILURE(map("first"));
  ASSERT_NO_FATAL_FAILURE(map("both", {"--extend", path("first")}));
  const json sessions = summary("both")["sessions"];
  ASSERT_EQ(sessions.size(), 2U);
  EXPECT_EQ(sessions[1]["session"], 2);
  EXPECT_GT(sessions[1]["walls_shared"], 300);
  EXPECT_LT(sessions[1]["contradicted_share"], 0.02);
  const auto frames = io::readSimpleMap(path("both/map.simplemap"));
  EXPECT_GT(frames.size(), io::readSimpleMap(path("first/map.simplemap")).size());
  EXPECT_EQ(frames.front().session, 1);
  EXPECT_EQ(frames.back().session, 2);
  // The same drive again lies on the first one.
  EXPECT_LT(
      distance(
          frames.back().T_map_base,
          io::readSimpleMap(path("first/map.simplemap")).back().T_map_base),
      0.05);
  // Nearly every cell was seen by both drives: bits 1 and 2.
  EXPECT_GT(layer("both")[3], 0.9 * (layer("both")[1] + layer("both")[2] + layer("both")[3]));
  const CommandResult cut =
      run({"map", "--extend", path("both"), "--cut", "2", "--out", path("cut")});
  EXPECT_EQ(cut.exit_code, 0) << cut.err;
  EXPECT_EQ(layer("cut")[2] + layer("cut")[3], 0);
  EXPECT_EQ(summary("cut")["sessions"].size(), 1U);
  EXPECT_EQ(
      io::readSimpleMap(path("cut/map.simplemap")).size(),
      io::readSimpleMap(path("first/map.simplemap")).size());
  const CommandResult wrong =
      run({"map", "--extend", path("both"), "--cut", "7", "--out", path("wrong")});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("--cut 7: no such session"));
}

TEST_F(MapDrive, ADamagedLogGivesTheMapOfWhatCameBefore) {
  const std::string whole = drive_.carmenLog(false);
  const std::size_t cut = whole.find("FLASER", whole.size() * 2 / 3);
  file("cut.log", whole.substr(0, cut + 40));
  const CommandResult result = run({"map", path("cut.log"), "--out", path("out")});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.err, testing::ContainsRegex("cut.log:[0-9]+: FLASER line has"));
  EXPECT_THAT(result.err, HasSubstr("the map is of the"));
  EXPECT_GT(io::readTum(path("out/trajectory.tum")).size(), 60U);
}

TEST_F(MapDrive, SaysWhatIsWrongWithTheRecording) {
  // GIVEN a laser that sees nothing
  std::string blind;
  for (int i = 0; i < 20; ++i) {
    blind += "FLASER 3 81.91 81.91 81.91 " + std::to_string(i) + " 0 0 " + std::to_string(i) +
             " 0 0 " + std::to_string(i) + " host 0\n";
  }
  const CommandResult nothing = run({"map", file("blind.log", blind), "--out", path("blind")});
  EXPECT_EQ(nothing.exit_code, 3);
  EXPECT_THAT(nothing.err, HasSubstr("no beam of its scans met anything"));
  expectNoOutput("blind");
  // GIVEN odometry that leaves the Earth after the whole drive
  const std::string away = drive_.carmenLog(false) + "ODOM 1e12 0 0 0 0 0 1100 host 0\n";
  const CommandResult far = run({"map", file("away.log", away), "--out", path("away")});
  EXPECT_EQ(far.exit_code, 3);
  EXPECT_THAT(far.err, testing::ContainsRegex("the odometry jumps by [0-9.]+ m at 1100.0+ s"));
  // THEN the map of what came before is there
  EXPECT_THAT(far.err, HasSubstr("the map is of the 140 scans before it"));
  EXPECT_EQ(io::readTum(path("away/trajectory.tum")).size(), drive_.poses.size());
}

TEST_F(MapDrive, FinishRefinesAllPosesAndSaysWhatItClosed) {
  ASSERT_NO_FATAL_FAILURE(map("out", {"--finish"}));
  const io::Trajectory poses = io::readTum(path("out/trajectory.tum"));
  ASSERT_EQ(poses.size(), drive_.poses.size());
  double worst_m = 0.0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Pose2 truth = between(drive_.poses.front(), drive_.poses[i]);
    worst_m =
        std::max(worst_m, distance(between(toPose2(poses.front().T), toPose2(poses[i].T)), truth));
  }
  EXPECT_LT(worst_m, 0.05);
  const json finish = summary("out")["finish"];
  EXPECT_GT(finish["key_scans"], 10);
  EXPECT_GT(finish["pairs"], finish["key_scans"]);
  EXPECT_LT(finish["surface_rms_after_m"], 0.03);
  EXPECT_TRUE(finish["closures"].contains("accepted"));
  EXPECT_EQ(
      io::readSimpleMap(path("out/map.simplemap")).size(), finish["key_scans"].get<std::size_t>());
  EXPECT_THAT(readFile(path("out/report.html")), HasSubstr("places recognised again"));
}

TEST_F(MapDrive, GeoreferenceIsWrittenOrRefused) {
  // GIVEN the drive in a room of twice the size, for fixes need some metres, with a fix at every
  // scan, turned by 30 degrees from the map that it will make
  constexpr double kSize = 2.0;
  const geo::TangentPlane plane({45.0, 7.0, 200.0});
  const double turn_rad = degToRad(30.0);
  const auto recordWith = [&](GnssFixType type, double sigma_m) {
    const std::string recording = path("gnss.rawlog");
    io::RawlogWriter writer(recording);
    RandomStream rng(1, "fixes");
    const auto reader = io::openRecording(path("raw.log"), {});
    std::size_t scan = 0;
    while (const auto record = reader->next()) {
      Measurement measurement = record->measurement;
      if (auto* wheels = std::get_if<WheelOdometry>(&measurement)) {
        wheels->T_previous_now.x *= kSize;
        wheels->T_previous_now.y *= kSize;
      }
      auto* echoes = std::get_if<LaserScan>(&measurement);
      if (echoes != nullptr) {
        for (float& range_m : echoes->ranges_m) range_m *= static_cast<float>(kSize);
      }
      writer.write(measurement, record->source);
      if (echoes == nullptr) continue;
      const Pose2 moved = between(drive_.poses.front(), drive_.poses[scan]);
      const Point2 p = transform(Pose2{0.0, 0.0, turn_rad}, {kSize * moved.x, kSize * moved.y});
      GnssFix fix;
      fix.stamp = drive_.stamps[scan++];
      fix.type = type;
      fix.position =
          plane.toGeodetic({p.x + rng.normal(0.0, sigma_m), p.y + rng.normal(0.0, sigma_m), 0.0});
      writer.write(fix, "GNSS");
    }
    writer.close();
    return recording;
  };
  // WHEN the fixes are to centimetres
  const std::string good = recordWith(GnssFixType::kRtkFixed, 0.02);
  const CommandResult done = run({"map", good, "--georeference", "--out", path("good")});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  // THEN the map knows where it lies
  const json georeference = summary("good")["georeference"];
  EXPECT_NEAR(georeference["T_map_grid"][2], 30.0, 2.0);
  EXPECT_LT(georeference["sigma_yaw_deg"], 15.0);
  EXPECT_THAT(readFile(path("good/map.yaml")), HasSubstr("georeference:"));
  // WHEN they are to metres, in a room of a few metres
  const std::string poor = recordWith(GnssFixType::kSingle, 2.0);
  const CommandResult refused = run({"map", poor, "--georeference", "--out", path("poor")});
  // THEN they do not tell its heading, and nothing is written
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(
      refused.err,
      testing::ContainsRegex(
          "140 GNSS fixes near scans leave the map's heading open to \\+-[0-9]+ deg"));
  EXPECT_THAT(refused.err, HasSubstr("leave --georeference out"));
  expectNoOutput("poor");
}

TEST_F(MapDrive, GmappingParametersByTheirNames) {
  const std::string params = file("gmapping.yaml", "particles: 4\nlinearUpdate: 0.5\nxmin: -10\n");
  ASSERT_NO_FATAL_FAILURE(map("out", {"--gmapping-params", params}));
  EXPECT_EQ(summary("out")["particles"], 4);
  EXPECT_THAT(summary("out")["notes"].dump(), HasSubstr("gmapping: xmin has no counterpart here"));
  EXPECT_THAT(readFile(path("out/config.resolved.yaml")), HasSubstr("update_d_m: 0.5"));
  const std::string wrong = file("wrong.yaml", "particels: 4\n");
  const CommandResult result =
      run({"map", path("raw.log"), "--gmapping-params", wrong, "--out", path("wrong")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("wrong.yaml:1: particels: unknown key"));
}

TEST_F(MapDrive, TheReportSaysWhatToTypeToGetItAgain) {
  ASSERT_NO_FATAL_FAILURE(map("out", {"--particles", "3", "--seed", "7"}));
  EXPECT_EQ(summary("out")["seed"], 7);
  EXPECT_THAT(
      readFile(path("out/report.html")),
      HasSubstr("vestibule map " + path("raw.log") + " --particles 3 --seed 7<"));
}

TEST_F(MapDrive, WrongCombinationsAreExplained) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases{
      {{}, "give a LOG to map"},
      {{path("raw.log"), "--cut", "1"}, "--cut needs --extend"},
      {{path("raw.log"), "--init", "0,0,0"}, "it needs --extend"},
      {{path("raw.log"), "--known-poses", "--resume"}, "--known-poses goes with none of"},
      {{path("raw.log"), "--georeference"}, "0 GNSS fixes"}};
  for (const auto& [arguments, text] : cases) {
    std::vector<std::string> command{"map"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    command.insert(command.end(), {"--out", path("out")});
    const CommandResult result = run(command);
    EXPECT_NE(result.exit_code, 0);
    EXPECT_THAT(result.err, HasSubstr(text));
    expectNoOutput("out");
  }
}

}  // namespace
}  // namespace vestibule::test
