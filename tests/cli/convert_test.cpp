// vestibule convert: the same content in another format, and no output where there is no way.

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "cli_fixture.hpp"
#include "room_log.hpp"
#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/io/trajectory.hpp"

namespace vestibule::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Convert : public Cli {
 protected:
  void convert(const std::string& in, const std::string& out, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments{"convert", in, path(out)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const CommandResult result = run(arguments);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.err, "");
  }

  [[nodiscard]] static std::vector<LaserScan> scansOf(const std::string& recording) {
    std::vector<LaserScan> scans;
    const auto reader = io::openRecording(recording, {});
    while (const auto record = reader->next()) {
      if (const auto* scan = std::get_if<LaserScan>(&record->measurement)) scans.push_back(*scan);
    }
    return scans;
  }

  /// What the wheels say between two messages.
  [[nodiscard]] static std::vector<Pose2> odometryOf(const std::string& recording) {
    std::vector<Pose2> steps;
    const auto reader = io::openRecording(recording, {});
    while (const auto record = reader->next()) {
      const auto* odometry = std::get_if<WheelOdometry>(&record->measurement);
      if (odometry != nullptr) steps.push_back(odometry->T_previous_now);
    }
    return steps;
  }
};

TEST_F(Convert, ARecordingKeepsItsScansAndTheirOrder) {
  const RoomDrive drive;
  const std::string log = file("raw.log", drive.carmenLog(false));
  ASSERT_NO_FATAL_FAILURE(convert(log, "raw.rawlog"));
  const auto before = scansOf(log);
  const auto after = scansOf(path("raw.rawlog"));
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_LT(std::abs(toSeconds(after[i].stamp - before[i].stamp)), 1e-6) << "scan " << i;
    ASSERT_EQ(after[i].ranges_m.size(), before[i].ranges_m.size());
    EXPECT_NEAR(after[i].ranges_m[90], before[i].ranges_m[90], 1e-4);
    EXPECT_NEAR(after[i].angle(0), before[i].angle(0), 1e-5);
  }
}

TEST_F(Convert, SlipsComeIntoTheOdometryAndNotIntoTheScans) {
  const RoomDrive drive;
  const std::string log = file("raw.log", drive.carmenLog(false));
  const CommandResult result =
      run({"convert", log, path("slips.rawlog"), "--slips", "10,1,20,1", "--seed", "3"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("slips put into the odometry"));
  EXPECT_EQ(scansOf(path("slips.rawlog")).size(), scansOf(log).size());
  // A second of each ten is off by up to a metre, and all others are as they were.
  const auto before = odometryOf(log);
  const auto after = odometryOf(path("slips.rawlog"));
  ASSERT_EQ(after.size(), before.size());
  double moved_m = 0.0;
  double turned_rad = 0.0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const Pose2 slip = between(before[i], after[i]);
    moved_m += translationNorm(slip);
    turned_rad += std::abs(slip.phi);
  }
  const double slips = std::floor(toSeconds(drive.stamps.back() - drive.stamps.front()) / 10.0);
  ASSERT_GE(slips, 1.0);
  EXPECT_NEAR(moved_m, slips, 0.2 * slips);
  EXPECT_NEAR(turned_rad, slips * degToRad(20.0), 0.2 * slips * degToRad(20.0));
  for (const char* wrong : {"10,1,20", "0,1,20,1", "10,-1,20,1"}) {
    const CommandResult bad = run({"convert", log, path("no.rawlog"), "--slips", wrong});
    EXPECT_EQ(bad.exit_code, 2);
    EXPECT_THAT(bad.err, HasSubstr("every_s,distance_m,turn_deg,lasts_s"));
  }
  const CommandResult map = run({"convert", roomMap(), path("no.yaml"), "--slips", "10,1,20,1"});
  EXPECT_EQ(map.exit_code, 2);
  EXPECT_THAT(map.err, HasSubstr("only a recording has odometry"));
}

TEST_F(Convert, AMapKeepsItsCells) {
  const std::string map = roomMap();
  ASSERT_NO_FATAL_FAILURE(convert(map, "again.yaml"));
  const auto before = io::loadMap(map);
  const auto after = io::loadMap(path("again.yaml"));
  for (const auto cell : {grid::Cell::kFree, grid::Cell::kOccupied, grid::Cell::kUnknown}) {
    EXPECT_EQ(after.count(cell), before.count(cell));
  }
}

TEST_F(Convert, ATrajectoryGoesToKittiAndGeoJson) {
  const std::string tum =
      file("t.tum", "1.0 0 0 0 0 0 0 1\n2.0 100 0 0 0 0 0.7071067811865476 0.7071067811865476\n");
  ASSERT_NO_FATAL_FAILURE(convert(tum, "t.kitti"));
  EXPECT_THAT(readFile(path("t.kitti")), testing::StartsWith("1 0 0 0 0 1 0 0 0 0 1 0\n"));
  ASSERT_NO_FATAL_FAILURE(convert(tum, "t.geojson", {"--datum", "40,-3.7,600"}));
  // A hundred metres east at 40 degrees north.
  const std::string text = readFile(path("t.geojson"));
  EXPECT_THAT(text, HasSubstr("-3.69882"));
  EXPECT_TRUE(json::accept(text));
  const CommandResult without = run({"convert", tum, path("no.geojson")});
  EXPECT_EQ(without.exit_code, 2);
  EXPECT_THAT(without.err, HasSubstr("needs --datum"));
}

TEST_F(Convert, ASweepIsSlicedAboveTheGround) {
  // GIVEN ground, and a wall 4 m ahead, from a lidar 1 m above the ground
  std::string points;
  int n = 0;
  for (int k = -20; k <= 20; ++k) {
    const std::string y = std::to_string(0.02 * k);
    for (const char* x : {"1.5", "2.5", "3.5"}) points += std::string(x) + " " + y + " -1.0\n";
    for (const char* z : {"-0.8", "-0.5", "-0.2", "0.1"}) points += "4.0 " + y + " " + z + "\n";
    n += 7;
  }
  const std::string count = std::to_string(n);
  const std::string pcd = file(
      "sweep.pcd",
      "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " +
          count + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + count + "\nDATA ascii\n" +
          points);
  ASSERT_NO_FATAL_FAILURE(convert(pcd, "scan.rawlog", {"--mount", "0.2,0,1,0,0,0"}));
  // THEN the scan has the wall, and no echo of the ground
  const auto scans = scansOf(path("scan.rawlog"));
  ASSERT_EQ(scans.size(), 1U);
  int echoes = 0;
  for (std::size_t i = 0; i < scans[0].ranges_m.size(); ++i) {
    if (!scans[0].valid(i)) continue;
    ++echoes;
    EXPECT_NEAR(scans[0].ranges_m[i] * std::cos(scans[0].angle(i)), 4.0, 0.02);
  }
  EXPECT_GT(echoes, 10);
}

TEST_F(Convert, NoWayBetweenTwoKindsIsExplained) {
  const std::string tum = file("t.tum", "1.0 0 0 0 0 0 0 1\n");
  const CommandResult result = run({"convert", tum, path("t.rawlog")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("no way from"));
  const std::string broken = file("broken.log", "FLASER 3 1 2\n");
  const CommandResult bad = run({"convert", broken, path("broken.rawlog")});
  EXPECT_EQ(bad.exit_code, 3);
  EXPECT_THAT(bad.err, HasSubstr("broken.log:1: FLASER"));
  EXPECT_FALSE(std::filesystem::exists(path("broken.rawlog")));
  EXPECT_FALSE(std::filesystem::exists(path("broken.rawlog.partial")));
}

}  // namespace
}  // namespace vestibule::test
