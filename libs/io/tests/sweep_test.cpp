#include <gmock/gmock.h>

#include <cmath>
#include <cstring>
#include <filesystem>

#include "matchers.hpp"
#include "temp_files.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/io/rawlog_writer.hpp"
#include "vestibule/io/sweep_io.hpp"
#include "vestibule/io/trajectory.hpp"

namespace vestibule::io {
namespace {

using testing::HasSubstr;

std::string header(const std::string& data, int points) {
  return "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z ring t\nSIZE 4 4 4 2 4\nTYPE F F F U F\n"
         "COUNT 1 1 1 1 1\nWIDTH " +
         std::to_string(points) + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " +
         std::to_string(points) + "\nDATA " + data + "\n";
}

template <class T>
void append(std::string& bytes, T value) {
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  bytes.append(raw, sizeof value);
}

void expectTwoPoints(const LidarSweep& sweep) {
  ASSERT_EQ(sweep.points.size(), 2U);
  EXPECT_FLOAT_EQ(sweep.points[0].p_laser.x(), 1.5F);
  EXPECT_FLOAT_EQ(sweep.points[0].p_laser.z(), -0.25F);
  EXPECT_EQ(sweep.points[1].ring, 7);
  EXPECT_FLOAT_EQ(sweep.points[1].time_offset_s, 0.05F);
  EXPECT_DOUBLE_EQ(sweep.T_base_laser.z, 0.9);
}

const Pose3 kMount{0.0, 0.0, 0.9, 0.0, 0.0, 0.0};

TEST(Pcd, AsciiBinaryAndCompressedAreTheSame) {
  const auto folder = testFolder();
  expectTwoPoints(readPcd(
      writeFile(
          folder / "a.pcd", header("ascii", 3) + "1.5 2 -0.25 3 0\nnan 0 0 0 0\n4 5 6 7 0.05\n"),
      kMount));
  const float xyz[3][3] = {{1.5F, 2.0F, -0.25F}, {NAN, 0.0F, 0.0F}, {4.0F, 5.0F, 6.0F}};
  const std::uint16_t ring[3] = {3, 0, 7};
  const float time[3] = {0.0F, 0.0F, 0.05F};
  std::string by_point;
  std::string by_field;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) append(by_point, xyz[i][k]);
    append(by_point, ring[i]);
    append(by_point, time[i]);
  }
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 3; ++i) append(by_field, xyz[i][k]);
  }
  for (const auto r : ring) append(by_field, r);
  for (const auto t : time) append(by_field, t);
  expectTwoPoints(readPcd(writeFile(folder / "b.pcd", header("binary", 3) + by_point), kMount));
  // LZF as literal runs of at most 32 bytes.
  std::string packed;
  for (std::size_t i = 0; i < by_field.size(); i += 32) {
    const std::string run = by_field.substr(i, 32);
    packed += static_cast<char>(run.size() - 1);
    packed += run;
  }
  std::string sizes;
  append(sizes, static_cast<std::uint32_t>(packed.size()));
  append(sizes, static_cast<std::uint32_t>(by_field.size()));
  const std::string head = header("binary_compressed", 3);
  expectTwoPoints(readPcd(writeFile(folder / "c.pcd", head + sizes + packed), kMount));
}

TEST(Pcd, CompressedRunsMayRepeat) {
  // GIVEN 16 points at the origin: a literal byte and a back reference over itself
  const std::string head =
      "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 16\nDATA binary_compressed\n";
  std::string packed("\x00\x00", 2);
  packed += std::string("\xE0\xB6\x00", 3);  // 1 + 7 + 182 + 2 = 192 bytes with the literal
  std::string sizes;
  append(sizes, static_cast<std::uint32_t>(packed.size()));
  append(sizes, std::uint32_t{192});
  const auto sweep = readPcd(writeFile(testFolder() / "a.pcd", head + sizes + packed), {});
  ASSERT_EQ(sweep.points.size(), 16U);
  EXPECT_EQ(sweep.points[15].p_laser.x(), 0.0F);
}

std::string pcdError(const std::string& bytes) {
  try {
    (void)readPcd(writeFile(testFolder() / "a.pcd", bytes), {});
  } catch (const InputError& e) {
    return e.what();
  }
  return {};
}

TEST(Pcd, BadFilesNameTheLine) {
  EXPECT_THAT(pcdError("hello\n"), HasSubstr("a.pcd:1"));
  EXPECT_THAT(pcdError("VERSION 0.7\nFIELDS x y\nSIZE 4 4 4\n"), HasSubstr("a.pcd:3"));
  EXPECT_THAT(pcdError("FIELDS x y\nPOINTS 1\nDATA ascii\n1 2\n"), HasSubstr("no field 'z'"));
  EXPECT_THAT(pcdError(header("zip", 1)), HasSubstr("none of ascii"));
  EXPECT_THAT(pcdError(header("ascii", 2) + "1 2 3 4 5\n"), HasSubstr("after 1 of 2 points"));
  EXPECT_THAT(pcdError(header("ascii", 1) + "1 2 x 4 5\n"), HasSubstr("a.pcd:12"));
  EXPECT_THAT(pcdError(header("binary", 9) + "12345"), HasSubstr("after 0 of 9 points"));
  EXPECT_THAT(pcdError(header("binary_compressed", 1) + "1234"), HasSubstr("cut off"));
  EXPECT_THAT(pcdError("FIELDS x y z\nPOINTS 1e30\n"), HasSubstr("'1e30'"));
  EXPECT_THAT(pcdError("FIELDS x y z\nPOINTS 1\n"), HasSubstr("without a DATA line"));
}

TEST(Pcd, DamagedFilesNeverDoWorseThanAnError) {
  std::string packed_sizes;
  append(packed_sizes, std::uint32_t{40});
  append(packed_sizes, std::uint32_t{54});
  const std::string good[] = {
      header("ascii", 2) + "1.5 2 -0.25 3 0\n4 5 6 7 0.05\n",
      header("binary", 3) + std::string(54, '\x3f'),
      header("binary_compressed", 3) + packed_sizes + std::string(40, '\x21')};
  const auto path = testFolder() / "a.pcd";
  RandomStream random(1, "damage");
  for (const std::string& bytes : good) {
    for (int i = 0; i < 300; ++i) {
      std::string damaged = bytes.substr(0, 1 + random() % bytes.size());
      damaged[random() % damaged.size()] = static_cast<char>(random() % 256);
      try {
        (void)readPcd(writeFile(path, damaged), {});
      } catch (const InputError&) {
      }
    }
  }
}

/// A wall 2 m ahead, five rings, measured in 0.1 s.
LidarSweep wallSweep(Timestamp stamp) {
  LidarSweep sweep;
  sweep.stamp = stamp;
  sweep.T_base_laser = {0.1, 0.0, 0.9, 0.0, 0.0, 0.0};
  for (int a = -100; a <= 100; ++a) {
    for (int ring = -2; ring <= 2; ++ring) {
      const double angle = 0.004 * a;
      sweep.points.push_back(
          {{2.0F, static_cast<float>(2.0 * std::tan(angle)), 0.1F * static_cast<float>(ring)},
           0.0005F * static_cast<float>(a + 100)});
    }
  }
  return sweep;
}

TEST(Sweeps, OfARawlogBecomeScansWhereAskedFor) {
  const std::string path = (testFolder() / "a.rawlog").string();
  const Timestamp stamp{1'700'000'000'000'000'000};
  {
    RawlogWriter writer(path);
    writer.write(wallSweep(stamp), "rings");
    writer.close();
  }
  EXPECT_TRUE(readAll(path).empty());
  RecordingOptions options;
  options.slice.emplace();
  const auto records = readAll(path, options);
  ASSERT_EQ(records.size(), 1U);
  EXPECT_EQ(records[0].source, "rings");
  const auto& scan = std::get<LaserScan>(records[0].measurement);
  EXPECT_NEAR(toSeconds(scan.stamp - stamp), 0.05, 1e-6) << "the mean of its points";
  EXPECT_NEAR(static_cast<double>(scan.ranges_m[360]), 2.0, 0.01) << "straight ahead";
  EXPECT_THAT(scan.T_base_laser, poseNear(Pose2{0.1, 0.0, 0.0}, 1e-6, 1e-6));
}

TEST(Sweeps, OfARealVelodyneAreSliced) {
  const std::string path = "/usr/share/mrpt/datasets/test_velodyne_VLP16.rawlog";
  ASSERT_TRUE(std::filesystem::exists(path)) << "the package mrpt-common has it";
  RecordingOptions options;
  options.slice.emplace();
  const auto records = readAll(path, options);
  ASSERT_EQ(records.size(), 1U);
  const auto& scan = std::get<LaserScan>(records[0].measurement);
  int valid = 0;
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) valid += scan.valid(i) ? 1 : 0;
  EXPECT_GT(valid, 100);
}

TEST(Trajectory, KittiAndGeoJson) {
  EXPECT_EQ(formatKittiLine(Pose3(1, 2, 3, 0, 0, 0)), "1 0 0 1 0 1 0 2 0 0 1 3\n");
  const std::string line = formatKittiLine(Pose3(0, 0, 0, kPi / 2.0, 0, 0));
  EXPECT_THAT(line, HasSubstr(" -1 0 0 1 "));
  EXPECT_EQ(
      toGeoJson({{50.0, 8.5, 100.0}}, "a.tum"),
      R"({"type":"FeatureCollection","features":[{"type":"Feature","properties":{"name":"a.tum"},)"
      R"("geometry":{"type":"LineString","coordinates":[[8.5,50.0,100.0]]}}]})"
      "\n");
}

}  // namespace
}  // namespace vestibule::io
