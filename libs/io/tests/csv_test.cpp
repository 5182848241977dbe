#include <gmock/gmock.h>

#include <cmath>

#include "matchers.hpp"
#include "temp_files.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/io/csv_mapping.hpp"

namespace vestibule::io {
namespace {

using testing::HasSubstr;

constexpr const char* kMapping = R"(
time: {column: t_us, unit_s: 1.0e-6}
gnss:
  - {name: gps, x: n, y: e, axes: north_east, type: single, sigma_m: 2.0, delay_s: 0.5}
wheels: {left: vl, right: vr, track_m: 0.5, distance_scale: 0.5}
heading: {column: h, clockwise_from_north: true, sigma_deg: 5.0}
yaw_rate: {from_heading: true}
reference: {x: n, y: e, yaw: h, axes: north_east, yaw_clockwise_from_north: true}
)";

RecordingOptions optionsWith(const std::filesystem::path& folder, const std::string& mapping) {
  RecordingOptions options;
  options.csv_mapping = writeFile(folder / "mapping.yaml", mapping);
  return options;
}

TEST(Csv, RowsBecomeMeasurementsInStampOrder) {
  const auto folder = testFolder();
  const auto options = optionsWith(folder, kMapping);
  const std::string path = writeFile(
      folder / "a.csv",
      "t_us, n, e, vl, vr, h\n"
      "1400000000000001,10,20,1,1,0\n"
      "1400000001000001,nan,,2,2,0.1\n"
      "1400000002000001,12,22,2,2,0.2\n");
  const auto records = readAll(path, options);
  std::vector<std::string> sources;
  for (const Record& r : records) sources.push_back(r.source);
  EXPECT_THAT(
      sources,
      testing::ElementsAre(
          "gps",
          "heading",
          "wheels",
          "yaw_rate",
          "heading",
          "gps",
          "wheels",
          "yaw_rate",
          "heading"));
  for (std::size_t i = 1; i < records.size(); ++i) {
    if (records[i].source == "heading") continue;
    EXPECT_GE(stampOf(records[i].measurement).ns, stampOf(records[i - 1].measurement).ns);
  }
  const auto& fix = std::get<GnssFix>(records[0].measurement);
  EXPECT_EQ(fix.stamp.ns, 1399999999500001000) << "the delay is taken off, no digit lost";
  EXPECT_EQ(std::get<LocalPosition>(fix.position).east_m, 20.0);
  EXPECT_EQ(std::get<LocalPosition>(fix.position).north_m, 10.0);
  EXPECT_EQ(fix.cov_enu.value()(0, 0), 4.0);
  EXPECT_NEAR(std::get<Heading>(records[1].measurement).yaw_rad, kPi / 2, 1e-12);
  EXPECT_THAT(
      std::get<WheelOdometry>(records[2].measurement).T_previous_now,
      poseNear(Pose2{1.0, 0.0, 0.0}, 1e-12, 1e-12));
  // Compass angles grow clockwise: the rate is negative.
  EXPECT_NEAR(std::get<Imu>(records[3].measurement).omega_radps.z(), -0.1, 1e-9);

  const auto reference = readReference(path, options);
  ASSERT_TRUE(reference);
  ASSERT_EQ(reference->size(), 2U);
  EXPECT_THAT(toPose2(reference->at(1).T), poseNear(Pose2{22.0, 12.0, kPi / 2 - 0.2}, 1e-9, 1e-9));
}

TEST(Csv, CarriesVelocityOriginAndCompass) {
  const auto folder = testFolder();
  const auto options = optionsWith(
      folder,
      "time: {column: t}\n"
      "gnss:\n"
      "  - {name: gps, x: n, y: e, v_x: vn, v_y: ve, sigma_mps: 0.1, axes: north_east,\n"
      "     origin_m: [1, 2]}\n"
      "heading:\n"
      "  column: h\n"
      "  clockwise_from_north: true\n"
      "  compass: {deviation_deg: [3, 0, 0, 0, 0], sigma_deg: 2}\n");
  const std::string path =
      writeFile(folder / "a.csv", "t,n,e,vn,ve,h\n0,10,20,0.5,-0.25,0\n1,10,20,nan,0,0\n");
  const auto records = readAll(path, options);
  ASSERT_EQ(records.size(), 4U);
  std::vector<GnssFix> fixes;
  std::vector<Heading> headings;
  for (const Record& r : records) {
    if (const auto* fix = std::get_if<GnssFix>(&r.measurement)) fixes.push_back(*fix);
    if (const auto* h = std::get_if<Heading>(&r.measurement)) headings.push_back(*h);
  }
  ASSERT_EQ(fixes.size(), 2U);
  EXPECT_EQ(std::get<LocalPosition>(fixes[0].position).east_m, 18.0);
  EXPECT_EQ(std::get<LocalPosition>(fixes[0].position).north_m, 9.0);
  ASSERT_TRUE(fixes[0].velocity);
  EXPECT_EQ(fixes[0].velocity->enu_mps.x(), -0.25);
  EXPECT_EQ(fixes[0].velocity->enu_mps.y(), 0.5);
  EXPECT_EQ(fixes[0].velocity->sigma_mps.value(), 0.1);
  EXPECT_FALSE(fixes[1].velocity) << "nan: not measured";
  ASSERT_EQ(headings.size(), 2U);
  // It read north, which is 3 degrees too far clockwise.
  EXPECT_NEAR(headings[0].yaw_rad, kPi / 2 + degToRad(3.0), 1e-12);
  EXPECT_NEAR(headings[0].offset_sigma_rad.value(), degToRad(2.0), 1e-12);
}

TEST(Csv, NanInARequiredColumnNamesLineAndColumn) {
  const auto folder = testFolder();
  const auto options = optionsWith(folder, kMapping);
  const std::string head = "t_us,n,e,vl,vr,h\n1,1,1,1,1,0\n";
  EXPECT_THAT(
      inputError(writeFile(folder / "w.csv", head + "2,1,1,nan,1,0\n"), options),
      testing::AllOf(HasSubstr("w.csv:3"), HasSubstr("'vl'"), HasSubstr("'nan'")));
  EXPECT_THAT(
      inputError(writeFile(folder / "t.csv", head + "nan,1,1,1,1,0\n"), options),
      testing::AllOf(HasSubstr("t.csv:3"), HasSubstr("'t_us'")));
  EXPECT_THAT(
      inputError(writeFile(folder / "i.csv", head + "2,inf,1,1,1,0\n"), options),
      testing::AllOf(HasSubstr("i.csv:3"), HasSubstr("'n'")));
  EXPECT_THAT(
      inputError(writeFile(folder / "x.csv", head + "2,abc,1,1,1,0\n"), options),
      HasSubstr("'abc'"));
  EXPECT_THAT(
      inputError(writeFile(folder / "c.csv", head + "2,1,1\n"), options),
      testing::AllOf(HasSubstr("c.csv:3: 3 cells"), HasSubstr("cut off")));
  EXPECT_THAT(
      inputError(writeFile(folder / "h.csv", "t_us,n,e,vl,vr,h\n"), options), HasSubstr("no rows"));
  EXPECT_THAT(
      inputError(writeFile(folder / "m.csv", "t_us,n,e\n1,2,3\n"), options),
      HasSubstr("no column 'vl'"));
  EXPECT_THAT(inputError(writeFile(folder / "e.csv", ""), options), HasSubstr("empty"));
}

TEST(Csv, TheMappingIsFoundByTheHeader) {
  const auto folder = testFolder();
  std::filesystem::create_directories(folder / "csv");
  writeFile(folder / "csv/a.yaml", "time: {column: stamp}\n");
  writeFile(folder / "csv/b.yaml", kMapping);
  RecordingOptions options;
  options.csv_mapping_dir = (folder / "csv").string();
  const std::string good =
      writeFile(folder / "a.csv", "h,vr,vl,e,n,t_us\n0,1,1,1,1,0\n0,1,1,1,1,1000000\n");
  EXPECT_FALSE(readAll(good, options).empty());
  const std::string bad = writeFile(folder / "b.csv", "time,lat,lon\n0,1,1\n");
  EXPECT_THAT(
      inputError(bad, options),
      testing::AllOf(HasSubstr("time,lat,lon"), HasSubstr("write a YAML")));
}

TEST(Csv, WrongMappingIsAConfigError) {
  const auto folder = testFolder();
  const std::string csv = writeFile(folder / "a.csv", "t\n1\n");
  for (const char* mapping :
       {"gnss: []\n",
        "time: {column: t}\nwheels: {left: a, right: b}\n",
        "time: {column: t}\ngnss: [{name: g, x: a, lat: b}]\n",
        "time: {column: t}\nyaw_rate: {from_heading: true}\n",
        "time: {colum: t}\n"}) {
    const auto options = optionsWith(folder, mapping);
    EXPECT_THROW((void)readAll(csv, options), ConfigError) << mapping;
  }
}

TEST(Csv, ShippedMappingsLoad) {
  const std::filesystem::path folder = std::filesystem::path(VESTIBULE_SOURCE_DIR) / "config/csv";
  int n = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const CsvMapping mapping = loadParams<CsvMapping>(entry.path().string());
    EXPECT_FALSE(mapping.columns().empty());
    // What is written back reads as the same mapping.
    const std::string text = dumpParams(mapping);
    EXPECT_EQ(dumpParams(parseParams<CsvMapping>(text, "dump")), text);
    ++n;
  }
  EXPECT_GE(n, 1);
}

}  // namespace
}  // namespace vestibule::io
