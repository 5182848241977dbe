#include <gmock/gmock.h>
#include <mrpt/io/CFileOutputStream.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/obs/CRawlog.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/serialization/CArchive.h>
#include <zlib.h>

#include <cmath>
#include <limits>
#include <map>

#include "matchers.hpp"
#include "temp_files.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/io/rawlog_writer.hpp"

namespace vestibule::io {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kStart_ns = 1400843350071346100;

LaserScan someScan(Timestamp stamp) {
  LaserScan scan;
  scan.stamp = stamp;
  scan.angle_min_rad = -1.0;
  scan.angle_step_rad = 0.01;
  scan.range_max_m = 30.0;
  for (int i = 0; i < 181; ++i) scan.ranges_m.push_back(1.0F + 0.1F * static_cast<float>(i));
  scan.ranges_m[7] = std::numeric_limits<float>::quiet_NaN();
  scan.ranges_m[8] = std::numeric_limits<float>::infinity();
  scan.ranges_m[9] = 30.0F;
  scan.T_base_laser = {0.2, -0.1, 0.3};
  return scan;
}

std::string writeSample(const std::filesystem::path& path, int rounds) {
  RawlogWriter writer(path.string());
  for (int i = 0; i < rounds; ++i) {
    const Timestamp t{kStart_ns + i * 100000000LL};
    writer.write(WheelOdometry{t, 0.1, {0.1, 0.01, 0.02}}, "wheels");
    writer.write(Imu{t, {0.1, 0.2, 0.3}, {1.0, 2.0, 9.8}}, "imu");
    writer.write(Heading{t, 0.5, std::nullopt, std::nullopt}, "compass");
    GnssFix fix;
    fix.stamp = t;
    fix.type = GnssFixType::kRtkFixed;
    fix.position = Geodetic{36.83, -2.41, 123.25};
    fix.hdop = 0.75;
    fix.satellites = 14;
    fix.velocity = GnssVelocity{{-0.6, 0.8, 0.1}, 0.05};
    writer.write(fix, "gnss");
    writer.write(someScan(t), "laser");
  }
  writer.close();
  return path.string();
}

TEST(Rawlog, WhatTheWriterWritesComesBack) {
  const auto records = readAll(writeSample(testFolder() / "a.rawlog", 3));
  ASSERT_EQ(records.size(), 15U);
  for (int i = 0; i < 3; ++i) {
    const Timestamp t{kStart_ns + i * 100000000LL};
    const auto* at = &records[static_cast<std::size_t>(5 * i)];
    const auto& odometry = std::get<WheelOdometry>(at[0].measurement);
    EXPECT_EQ(at[0].source, "wheels");
    EXPECT_EQ(odometry.stamp.ns, t.ns);
    EXPECT_NEAR(odometry.dt_s, 0.1, 1e-9);
    EXPECT_THAT(odometry.T_previous_now, poseNear(Pose2{0.1, 0.01, 0.02}, 1e-9, 1e-9));
    const auto& imu = std::get<Imu>(at[1].measurement);
    EXPECT_LT((imu.omega_radps - Eigen::Vector3d(0.1, 0.2, 0.3)).norm(), 1e-12);
    EXPECT_LT((imu.accel_mps2 - Eigen::Vector3d(1.0, 2.0, 9.8)).norm(), 1e-12);
    EXPECT_NEAR(std::get<Heading>(at[2].measurement).yaw_rad, 0.5, 1e-12);
    const auto& fix = std::get<GnssFix>(at[3].measurement);
    EXPECT_EQ(fix.type, GnssFixType::kRtkFixed);
    EXPECT_EQ(std::get<Geodetic>(fix.position).lat_deg, 36.83);
    EXPECT_EQ(std::get<Geodetic>(fix.position).height_m, 123.25);
    EXPECT_EQ(fix.hdop, 0.75);
    EXPECT_EQ(fix.satellites, 14);
    EXPECT_FALSE(fix.cov_enu) << "unknown is not zero";
    ASSERT_TRUE(fix.velocity);
    EXPECT_LT((fix.velocity->enu_mps.head<2>() - Eigen::Vector2d(-0.6, 0.8)).norm(), 1e-9);
    EXPECT_TRUE(std::isnan(fix.velocity->enu_mps.z())) << "RMC has speed and course only";
    EXPECT_FALSE(fix.velocity->sigma_mps);

    const auto& scan = std::get<LaserScan>(at[4].measurement);
    const LaserScan expected = someScan(t);
    ASSERT_EQ(scan.ranges_m.size(), expected.ranges_m.size());
    for (std::size_t k = 0; k < scan.ranges_m.size(); ++k) {
      ASSERT_EQ(scan.valid(k), expected.valid(k)) << "beam " << k;
      if (!scan.valid(k)) continue;
      ASSERT_EQ(scan.ranges_m[k], expected.ranges_m[k]) << "beam " << k;
      // The direction on the robot, whatever share of it the mount carries.
      ASSERT_NEAR(
          angleDiff(
              scan.angle(k) + scan.T_base_laser.phi, expected.angle(k) + expected.T_base_laser.phi),
          0.0,
          1e-6)
          << "beam " << k;
    }
    EXPECT_TRUE(std::isnan(scan.ranges_m[7])) << "a failed beam";
    EXPECT_TRUE(std::isinf(scan.ranges_m[8])) << "a beam without an echo";
    EXPECT_TRUE(std::isinf(scan.ranges_m[9])) << "the same";
    EXPECT_NEAR(scan.T_base_laser.x, 0.2, 1e-9);
  }
}

TEST(Rawlog, MrptsOwnReaderLoadsIt) {
  // What RawLogViewer and rawlog-edit open files with.
  mrpt::obs::CRawlog log;
  ASSERT_TRUE(log.loadFromRawLogFile(writeSample(testFolder() / "mrpt.rawlog", 3)));
  ASSERT_EQ(log.size(), 16U) << "the wheels' start pose and five messages a round";
  std::map<std::string, int> labels;
  for (std::size_t i = 0; i < log.size(); ++i) {
    ASSERT_EQ(log.getType(i), mrpt::obs::CRawlog::etObservation);
    ++labels[log.getAsObservation(i)->sensorLabel];
  }
  EXPECT_THAT(
      labels,
      testing::ElementsAre(
          testing::Pair("compass", 3),
          testing::Pair("gnss", 3),
          testing::Pair("imu", 3),
          testing::Pair("laser", 3),
          testing::Pair("wheels", 4)));
}

TEST(Rawlog, StampsKeepHundredNanoseconds) {
  const auto path = testFolder() / "a.rawlog";
  {
    RawlogWriter writer(path.string());
    writer.write(Heading{{kStart_ns + 149}, 0.5, std::nullopt, std::nullopt}, "compass");
  }
  EXPECT_EQ(stampOf(readAll(path.string()).at(0).measurement).ns, kStart_ns + 100);
}

TEST(Rawlog, LocalMetresNeedADatum) {
  RawlogWriter writer((testFolder() / "a.rawlog").string());
  GnssFix fix;
  fix.position = LocalPosition{1.0, 2.0, 3.0};
  EXPECT_THROW(writer.write(fix, "gps"), ConfigError);
}

TEST(Rawlog, ActionsTakeTheStampOfTheirFramesScan) {
  // GIVEN a log of actions (without stamps) and sensory frames, and a scanner turning clockwise
  using namespace mrpt::obs;
  const auto path = testFolder() / "as.rawlog";
  {
    mrpt::io::CFileOutputStream stream(path.string());
    auto archive = mrpt::serialization::archiveFrom(stream);
    for (int i = 0; i < 3; ++i) {
      CActionRobotMovement2D move;
      CActionRobotMovement2D::TMotionModelOptions model;
      move.computeFromOdometry(mrpt::poses::CPose2D(0.1, 0.0, 0.05), model);
      CActionCollection actions;
      actions.insert(move);
      archive << actions;
      auto scan = CObservation2DRangeScan::Create();
      scan->timestamp = mrpt::Clock::fromDouble(1000.0 + 0.25 * i);
      scan->resizeScanAndAssign(3, 5.0F, true);
      scan->setScanRange(0, 1.0F);
      scan->setScanRangeValidity(1, false);
      scan->rightToLeft = false;
      CSensoryFrame frame;
      frame.insert(scan);
      archive << frame;
    }
    CObservationComment comment;
    archive << comment;
  }
  const auto reader = openRecording(path.string(), {});
  std::vector<Record> records;
  while (auto record = reader->next()) records.push_back(std::move(*record));
  ASSERT_EQ(records.size(), 6U);
  const auto& move = std::get<WheelOdometry>(records[2].measurement);
  EXPECT_EQ(move.stamp.ns, 1000250000000);
  EXPECT_TRUE(move.stamp_borrowed);
  EXPECT_NEAR(move.dt_s, 0.25, 1e-9);
  EXPECT_THAT(move.T_previous_now, poseNear(Pose2{0.1, 0.0, 0.05}, 1e-9, 1e-9));
  const auto& scan = std::get<LaserScan>(records[1].measurement);
  EXPECT_FLOAT_EQ(scan.ranges_m[2], 1.0F) << "the first beam of a clockwise scan is the leftmost";
  EXPECT_FALSE(scan.valid(1));
  EXPECT_THAT(
      reader->notes(), testing::ElementsAre(HasSubstr("CObservationComment objects ignored: 1")));
}

TEST(Rawlog, CutOffAndDamagedFilesAreToldFromTheEnd) {
  const auto folder = testFolder();
  const std::string path = writeSample(folder / "a.rawlog", 3);
  // The plain bytes, to cut at will.
  std::string plain(1 << 16, '\0');
  gzFile file = gzopen(path.c_str(), "rb");
  plain.resize(static_cast<std::size_t>(gzread(file, plain.data(), 1 << 16)));
  gzclose(file);
  ASSERT_EQ(readAll(writeFile(folder / "plain.rawlog", plain)).size(), 15U);

  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  const std::string cut =
      inputError(writeFile(folder / "cut.rawlog", plain.substr(0, plain.size() - 100)));
  EXPECT_THAT(cut, HasSubstr("record 16"));
  EXPECT_THAT(cut, HasSubstr("cut off"));
  std::string damaged_bytes = plain;
  damaged_bytes.replace(plain.size() / 2, 400, 400, '\x5a');
  const std::string damaged = inputError(writeFile(folder / "damaged.rawlog", damaged_bytes));
  EXPECT_THAT(damaged, HasSubstr("record"));
  EXPECT_THAT(
      inputError(writeFile(folder / "cut.rawlog.gz", readFile(path).substr(0, 200))),
      HasSubstr("cut off"));
  EXPECT_THAT(
      inputError(writeFile(folder / "garbage.rawlog", "this is not a rawlog")),
      HasSubstr("not an MRPT rawlog"));
  EXPECT_THAT(inputError(writeFile(folder / "empty.rawlog", "")), HasSubstr("empty"));
  EXPECT_THAT(inputError((folder / "none.rawlog").string()), HasSubstr("no such file"));
  // THEN nothing was printed: the library has no business on the terminal
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace vestibule::io
