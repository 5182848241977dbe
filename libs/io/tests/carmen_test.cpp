#include <bzlib.h>
#include <gmock/gmock.h>
#include <zlib.h>

#include "matchers.hpp"
#include "temp_files.hpp"
#include "vestibule/core/angles.hpp"

namespace vestibule::io {
namespace {

using testing::HasSubstr;

std::string flaser(
    const std::string& laser, const std::string& robot, const std::string& stamp, int n = 4) {
  std::string line = "FLASER " + std::to_string(n);
  for (int i = 0; i < n; ++i) line += " " + std::to_string(1 + i) + ".50";
  return line + " " + laser + " " + robot + " " + stamp + " host 0.5\n";
}

TEST(Carmen, FlaserGivesIncrementThenScan) {
  // GIVEN ODOM and FLASER lines of one odometry, the laser 0.2 m ahead
  const std::string path = writeFile(
      testFolder() / "a.log",
      "# a comment\nPARAM robot_width 0.5\n"
      "ODOM 1 0 0 0 0 0 976052857.337284 host 0.1\n" +
          flaser("1.3 0 0", "1.1 0 0", "976052857.437530") +
          flaser("1.1 0.7 1.570796327", "1.1 0.5 1.570796327", "976052857.937530"));
  const auto records = readAll(path);
  ASSERT_EQ(records.size(), 4U);
  // THEN increments follow the running pose and never count a way twice
  const auto& first = std::get<WheelOdometry>(records[0].measurement);
  EXPECT_EQ(records[0].number, 4U);
  EXPECT_EQ(records[0].source, "FLASER");
  EXPECT_EQ(first.stamp.ns, 976052857437530000);
  EXPECT_NEAR(first.dt_s, 0.100246, 1e-9);
  EXPECT_THAT(first.T_previous_now, poseNear(Pose2{0.1, 0.0, 0.0}, 1e-9, 1e-9));
  const auto& turn = std::get<WheelOdometry>(records[2].measurement);
  EXPECT_THAT(turn.T_previous_now, poseNear(Pose2{0.0, 0.5, kPi / 2}, 1e-6, 1e-6));
  // THEN the scan knows its stamp, mount and the robot's pose
  const auto& scan = std::get<LaserScan>(records[3].measurement);
  EXPECT_EQ(scan.stamp.ns, 976052857937530000);
  EXPECT_THAT(scan.T_base_laser, poseNear(Pose2{0.2, 0.0, 0.0}, 1e-6, 1e-6));
  ASSERT_TRUE(scan.T_log_base);
  EXPECT_THAT(*scan.T_log_base, poseNear(Pose2{1.1, 0.5, kPi / 2}, 1e-6, 1e-6));
  EXPECT_FLOAT_EQ(scan.ranges_m[3], 4.5F);
}

TEST(Carmen, BeamDirectionsDependOnTheCount) {
  const auto folder = testFolder();
  for (const auto& [n, step_deg] : {std::pair{180, 1.0}, {181, 1.0}, {360, 0.5}, {361, 0.5}}) {
    const std::string path = writeFile(folder / "a.log", flaser("0 0 0", "0 0 0", "10.0", n));
    const auto records = readAll(path);
    ASSERT_EQ(records.size(), 1U);
    const auto& scan = std::get<LaserScan>(records[0].measurement);
    EXPECT_NEAR(radToDeg(scan.angle_min_rad), -90.0, 1e-9) << n << " beams";
    EXPECT_NEAR(radToDeg(scan.angle_step_rad), step_deg, 1e-9) << n << " beams";
  }
}

TEST(Carmen, RobotLaserUsesItsOwnStart) {
  const std::string line =
      "ROBOTLASER1 0 -1.557706 3.141593 0.017453 81.9 0.01 0 3 1.5 81.91 2.5 1 7 "
      "0.22 0 0 0 0 0 0 0 0.1 0.1 0 1232658478.161285 host 1.0\n";
  const auto records = readAll(writeFile(testFolder() / "a.clf", line));
  ASSERT_EQ(records.size(), 1U);
  const auto& scan = std::get<LaserScan>(records[0].measurement);
  EXPECT_EQ(scan.stamp.ns, 1232658478161285000);
  EXPECT_NEAR(scan.angle_min_rad, -1.557706, 1e-12);
  EXPECT_NEAR(radToDeg(scan.angle_step_rad), 1.0, 1e-9);
  EXPECT_TRUE(scan.valid(0));
  EXPECT_FALSE(scan.valid(1)) << "81.91 m is the scanner's code for no echo";
  EXPECT_THAT(scan.T_base_laser, poseNear(Pose2{0.22, 0.0, 0.0}, 1e-9, 1e-9));
}

/// The same line of another laser.
std::string as(const std::string& keyword, const std::string& line) {
  return keyword + line.substr(line.find(' '));
}

TEST(Carmen, RearLaserIsReadWhereThereIsNoFrontOne) {
  const auto folder = testFolder();
  const std::string front = flaser("0.2 0 0", "0 0 0", "1.0");
  const std::string rear = as("RLASER", flaser("-0.3 0 3.141593", "0 0 0", "1.0", 3));
  // GIVEN both lasers: the front one is read, also where it comes second
  const auto both = readAll(writeFile(folder / "both.log", rear + front));
  ASSERT_EQ(both.size(), 1U);
  EXPECT_EQ(both[0].source, "FLASER");
  // GIVEN the rear one alone: it is read, at its own place
  const auto alone = readAll(writeFile(folder / "rear.log", rear));
  ASSERT_EQ(alone.size(), 1U);
  const auto& scan = std::get<LaserScan>(alone[0].measurement);
  EXPECT_EQ(scan.ranges_m.size(), 3U);
  EXPECT_THAT(scan.T_base_laser, poseNear(Pose2{-0.3, 0.0, kPi}, 1e-5, 1e-5));
  // GIVEN that its place is not said: it looks back, and a note says so
  const auto reader = openRecording(
      writeFile(folder / "where.log", as("RLASER", flaser("1 1 0", "1 1 0", "1.0"))), {});
  const auto record = reader->next();
  ASSERT_TRUE(record);
  EXPECT_THAT(
      std::get<LaserScan>(record->measurement).T_base_laser,
      poseNear(Pose2{0.0, 0.0, kPi}, 1e-9, 1e-9));
  EXPECT_THAT(reader->notes(), testing::ElementsAre(HasSubstr("rig.laser")));
}

TEST(Carmen, RawLaserTakesItsOdometryFromOdomLines) {
  const auto folder = testFolder();
  const std::string raw =
      "RAWLASER2 0 -1.570796 3.141593 0.017453 81.9 0.01 0 2 1.5 2.5 0 1.2 host 1.0\n";
  const std::string odometry = "ODOM 0 0 0 0 0 0 1.0 host 0.1\nODOM 1 0 0 0 0 0 1.1 host 0.2\n";
  const auto records = readAll(writeFile(folder / "raw.log", odometry + raw));
  ASSERT_EQ(records.size(), 2U);
  EXPECT_EQ(records[0].source, "ODOM");
  const auto& scan = std::get<LaserScan>(records[1].measurement);
  EXPECT_EQ(scan.stamp.ns, 1200000000);
  EXPECT_FALSE(scan.T_log_base) << "the line carries no pose";
  EXPECT_FLOAT_EQ(scan.ranges_m.at(1), 2.5F);
  // A log that has the same readings with poses is read by those.
  const auto merged =
      readAll(writeFile(folder / "merged.log", odometry + raw + flaser("0 0 0", "1 0 0", "1.2")));
  ASSERT_EQ(merged.size(), 3U);
  EXPECT_EQ(merged[2].source, "FLASER");
  EXPECT_THAT(
      inputError(writeFile(folder / "cut.log", raw.substr(0, raw.find(" 1.2 host")))),
      HasSubstr("cut.log:1: RAWLASER2 line has 12 words instead of 15"));
}

TEST(Carmen, ReadsCentimetreLogs) {
  const std::string path = writeFile(
      testFolder() / "wean.log",
      "L 0 0 0 25 0 0 100 200 300 0.5\nO 10 0 0 0.6\nL 20 0 0 45 0 0 100 200 300 0.7\n");
  const auto records = readAll(path);
  ASSERT_EQ(records.size(), 4U);
  EXPECT_FLOAT_EQ(std::get<LaserScan>(records[0].measurement).ranges_m[2], 3.0F);
  const auto& scan = std::get<LaserScan>(records[3].measurement);
  EXPECT_THAT(scan.T_base_laser, poseNear(Pose2{0.25, 0.0, 0.0}, 1e-9, 1e-9));
  EXPECT_THAT(
      std::get<WheelOdometry>(records[2].measurement).T_previous_now,
      poseNear(Pose2{0.1, 0.0, 0.0}, 1e-9, 1e-9));
}

TEST(Carmen, ScansOfCentimetreLogsAreAsOldAsTheirOdometry) {
  // GIVEN scans written after odometry that the robot reached after they were taken
  const std::string path = writeFile(
      testFolder() / "wean.log",
      "O 0 0 0 1.0\nO 10 0 0 1.1\nL 5 0 0 30 0 0 100 200 1.12\nO 20 0 0 1.2\nO 30 0 0 1.3\n"
      "L 20 0 0 45 0 0 100 200 1.31\nO 40 0 0 1.4\nL 50 0 0 75 0 0 100 200 1.45\nO 60 0 0 1.5\n");
  // WHEN it is read
  double x_m = 0.0;
  std::vector<std::pair<double, double>> scans;  // where and when
  Timestamp last{0};
  for (const Record& record : readAll(path)) {
    if (const auto* odometry = std::get_if<WheelOdometry>(&record.measurement)) {
      EXPECT_GE(odometry->T_previous_now.x, 0.0) << "the robot did not drive back";
      EXPECT_GE(odometry->stamp, last);
      last = odometry->stamp;
      x_m += odometry->T_previous_now.x;
    } else {
      const auto& scan = std::get<LaserScan>(record.measurement);
      EXPECT_EQ(scan.stamp, last) << "the odometry is that of the scan";
      scans.emplace_back(x_m, toSeconds(scan.stamp - Timestamp{0}));
    }
  }
  // THEN scans come where their odometry was, and all of the way is there
  ASSERT_EQ(scans.size(), 3U);
  EXPECT_NEAR(scans[0].first, 0.05, 1e-9);
  EXPECT_NEAR(scans[0].second, 1.05, 1e-6);
  EXPECT_NEAR(scans[1].first, 0.20, 1e-9);
  EXPECT_NEAR(scans[1].second, 1.20, 1e-6);
  EXPECT_NEAR(scans[2].first, 0.50, 1e-9) << "odometry of its own: the robot has got farther";
  EXPECT_NEAR(scans[2].second, 1.45, 1e-6);
  EXPECT_NEAR(x_m, 0.60, 1e-9);
}

TEST(Carmen, TwoEqualPosesLeaveTheMountToTheRig) {
  RecordingOptions options;
  options.rig.T_base_laser = {0.3, 0.0, 0.0};
  const auto records =
      readAll(writeFile(testFolder() / "a.log", flaser("1 1 0", "1 1 0", "1.0")), options);
  EXPECT_THAT(
      std::get<LaserScan>(records.at(0).measurement).T_base_laser,
      poseNear(Pose2{0.3, 0.0, 0.0}, 1e-9, 1e-9));
}

TEST(Carmen, CompressedFilesAreKnownByContent) {
  const auto folder = testFolder();
  std::string text;
  for (int i = 0; i < 200; ++i) text += flaser("1 1 0", "1 1 0", std::to_string(i) + ".25", 180);
  // Names that lie about the compression.
  const std::string gz = (folder / "a.clf").string();
  gzFile file = gzopen(gz.c_str(), "wb");
  gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
  gzclose(file);
  std::string packed(text.size() + 1000, '\0');
  auto size = static_cast<unsigned>(packed.size());
  ASSERT_EQ(
      BZ2_bzBuffToBuffCompress(
          packed.data(), &size, text.data(), static_cast<unsigned>(text.size()), 9, 0, 0),
      BZ_OK);
  packed.resize(size);
  const std::string bz2 = writeFile(folder / "b.log", packed);
  EXPECT_EQ(readAll(gz).size(), 399U);
  EXPECT_EQ(readAll(bz2).size(), 399U);

  const std::string cut_gz = writeFile(folder / "c.log.gz", readFile(gz).substr(0, 300));
  EXPECT_THAT(inputError(cut_gz), HasSubstr("damaged or cut off"));
  const std::string cut_bz2 = writeFile(folder / "c.log.bz2", packed.substr(0, size - 20));
  EXPECT_THAT(inputError(cut_bz2), HasSubstr("damaged or cut off"));
}

TEST(Carmen, BadInputNamesTheLine) {
  const auto folder = testFolder();
  const std::string good = flaser("1 1 0", "1 1 0", "1.0");
  EXPECT_THAT(inputError((folder / "none.log").string()), HasSubstr("no such file"));
  EXPECT_THAT(inputError(folder.string()), HasSubstr("is a folder"));
  EXPECT_THAT(inputError(writeFile(folder / "e.log", "")), HasSubstr("empty"));
  EXPECT_THAT(
      inputError(writeFile(folder / "t.log", good + good.substr(0, 30))),
      HasSubstr("t.log:2: FLASER line has"));
  EXPECT_THAT(
      inputError(writeFile(folder / "n.log", good + flaser("nan 1 0", "1 1 0", "2.0"))),
      HasSubstr("n.log:2: word 7 of the FLASER line is 'nan'"));
  EXPECT_THAT(
      inputError(writeFile(folder / "w.log", good + flaser("1 1 0", "1 1 0", "2,0"))),
      HasSubstr("'2,0', not a time"));
  EXPECT_THAT(
      inputError(writeFile(folder / "g.log", "\x01\x02\x03\xff garbage\n")),
      HasSubstr("not a CARMEN log"));
  EXPECT_THAT(
      inputError(writeFile(folder / "h.log", good + "\x01\x02\xff garbage\n")),
      HasSubstr("h.log:2"));
  EXPECT_THAT(
      inputError(writeFile(folder / "p.log", "PARAM a b\n")), HasSubstr("without any laser"));
  EXPECT_THAT(
      inputError(writeFile(folder / "c.log", "FLASER 1000000000000 1 2\n")),
      HasSubstr("not a number of readings"));
}

TEST(Carmen, UnknownLinesAreCounted) {
  const std::string path =
      writeFile(testFolder() / "a.log", "NEFF 3\nNEFF 4\n" + flaser("0 0 0", "0 0 0", "1.0"));
  const auto reader = openRecording(path, {});
  while (reader->next()) {
  }
  EXPECT_THAT(reader->notes(), testing::ElementsAre(HasSubstr("'NEFF' lines ignored: 2")));
  EXPECT_DOUBLE_EQ(reader->progress(), 1.0);
}

}  // namespace
}  // namespace vestibule::io
