// Ground that is not level: its files, its rays, and what it does to a robot on it.

#include "vestibule/sim/terrain.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "moments.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/sim/ground_rays.hpp"
#include "vestibule/sim/simulator.hpp"

namespace vestibule::sim {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

/// A folder of the running test's own, since tests run beside each other; ends in a slash.
std::string folder() {
  const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
  const std::string path =
      ::testing::TempDir() + "vestibule_" + test->test_suite_name() + "_" + test->name() + "/";
  std::filesystem::create_directories(path);
  return path;
}

/// The world with this text after name and datum, in a file beside the files it names.
std::string worldFile(const std::string& yaml) {
  const std::string path = folder() + "sim_terrain.yaml";
  std::ofstream(path) << "name: w\ndatum: [36.8, -2.4, 20]\n" << yaml;
  return path;
}

std::string refusal(const std::string& yaml) {
  try {
    (void)loadWorld(worldFile(yaml));
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "accepted";
}

/// Four columns, two rows; the upper left cell is the highest.
void writePicture(const std::string& file, int type, double low, double high) {
  cv::Mat picture(2, 4, type, cv::Scalar(low));
  picture.colRange(0, 1).rowRange(0, 1).setTo(high);
  ASSERT_TRUE(cv::imwrite(folder() + file, picture));
}

TEST(HeightFiles, PicturesOfAllDepthsAndAscGridsSayTheSame) {
  writePicture("heights8.png", CV_8UC1, 51, 255);
  writePicture("heights16.png", CV_16UC1, 13107, 65535);
  writePicture("heights.tiff", CV_32FC1, 0.2, 3.0);
  std::ofstream(folder() + "heights.asc")
      << "ncols 4\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 0.5\nNODATA_value -9999\n"
         "3.0 0.2 0.2 0.2\n0.2 0.2 0.2 -9999\n";
  const std::string where = "resolution_m: 0.5, origin: [10, 20, 90]";
  for (const std::string source :
       {"image: heights8.png, low_m: -0.5, high_m: 3.0, ",
        "image: heights16.png, low_m: -0.5, high_m: 3.0, ",
        "image: heights.tiff, ",
        "image: heights.asc, "}) {
    SCOPED_TRACE(source);
    const WorldGeometry geometry(loadWorld(worldFile("height_field: {" + source + where + "}\n")));
    // The picture lies turned: its rows go west from x = 10, its columns north from y = 20.
    EXPECT_NEAR(geometry.groundHeight({9.25, 20.25}), 3.0, 1e-4);
    EXPECT_NEAR(geometry.groundHeight({9.75, 20.25}), 0.2, 1e-4);
    EXPECT_NEAR(geometry.groundHeight({9.25, 20.5}), 1.6, 1e-4) << "half way to the next cell";
    EXPECT_NEAR(geometry.groundHeight({9.25, 21.7}), 0.2, 1e-4);
    EXPECT_EQ(geometry.groundHeight({9.25, 22.3}), 0.0) << "outside";
    EXPECT_EQ(
        geometry.groundHeight({9.75, 21.75}),
        source.find("asc") == std::string::npos ? geometry.groundHeight({9.75, 21.0}) : 0.0)
        << "no data";
  }
}

TEST(HeightFiles, BadOnesAreRefusedByLine) {
  const auto write = [](const std::string& file, const std::string& text) {
    std::ofstream(folder() + file) << text;
  };
  write("text.png", "not a picture");
  write("empty.png", "");
  write("headless.asc", "1 2 3\n");
  write("short.asc", "ncols 3\nnrows 2\ncellsize 1\n1 2 3\n4 5\n");
  write("huge.asc", "ncols 1e9\nnrows 1e9\ncellsize 1\n1\n");
  cv::Mat gap(1, 2, CV_32FC1, cv::Scalar(std::nan("")));
  ASSERT_TRUE(cv::imwrite(folder() + "gap.tiff", gap));
  const auto field = [](const std::string& file) {
    return refusal("\nheight_field:\n  image: " + file + "\n");
  };
  EXPECT_THAT(field("none.png"), HasSubstr("sim_terrain.yaml:5: "));
  EXPECT_THAT(field("none.png"), HasSubstr("none.png: no such file"));
  EXPECT_THAT(field("text.png"), HasSubstr("text.png: not a picture of heights"));
  EXPECT_THAT(field("empty.png"), HasSubstr("empty.png: not a picture of heights"));
  EXPECT_THAT(field("headless.asc"), HasSubstr("needs ncols, nrows and cellsize"));
  EXPECT_THAT(field("short.asc"), HasSubstr("short.asc: ends before its last height"));
  EXPECT_THAT(field("huge.asc"), HasSubstr("needs ncols, nrows and cellsize"));
  EXPECT_THAT(field("gap.tiff"), HasSubstr("gap.tiff: has heights that are not finite"));
  EXPECT_THAT(
      refusal("height_field: {image: text.png, low_m: 2, high_m: 1}\n"),
      HasSubstr("sim_terrain.yaml:3: height_field.high_m: must be above low_m"));
  EXPECT_THAT(
      refusal("height_field: {image: text.png, resolution_m: -1}\n"),
      HasSubstr("sim_terrain.yaml:3: height_field.resolution_m"));
}

/// Hills of a few metres under a plate and a ramp.
Terrain hills() {
  Terrain terrain;
  HeightField field;
  field.resolution_m = 0.7;
  field.T_map_image = {-20.0, -15.0, 0.4};
  field.columns = 60;
  field.rows = 50;
  RandomStream random(3, "hills");
  for (int i = 0; i < field.columns * field.rows; ++i) {
    const double slope = std::sin(0.15 * (i % field.columns)) * std::cos(0.2 * (i / field.columns));
    field.heights_m.push_back(static_cast<float>(2.0 * slope + 0.1 * random.normal()));
  }
  terrain.fields.push_back(field);
  terrain.plates.push_back({{{5, -5}, {12, -5}, {12, 2}, {5, 2}}, -1.0});
  terrain.ramps.push_back({{-2, -1.5}, {5, -1.5}, 3.0, 1.5, -2.5});
  return terrain;
}

TEST(GroundRays, AgreeWithAMarchInTinySteps) {
  const Terrain terrain = hills();
  const GroundRays rays(terrain);
  RandomStream random(9, "rays");
  constexpr double kMax_m = 30.0;
  constexpr double kTiny_m = 0.002;
  int hits = 0;
  int misses = 0;
  int late = 0;
  for (int i = 0; i < 500; ++i) {
    Eigen::Vector3d from(random.uniform(-35, 35), random.uniform(-30, 30), 0.0);
    from.z() = terrain.height({from.x(), from.y()}) + random.uniform(0.1, 3.0);
    const double azimuth = random.uniform(-kPi, kPi);
    const double elevation = random.uniform(-0.6, 0.15);
    const Eigen::Vector3d along(
        std::cos(elevation) * std::cos(azimuth),
        std::cos(elevation) * std::sin(azimuth),
        std::sin(elevation));
    double expected_m = kMax_m;
    for (double range = 0.0; range < kMax_m; range += kTiny_m) {
      const Eigen::Vector3d p = from + range * along;
      if (p.z() > terrain.height({p.x(), p.y()})) continue;
      expected_m = range;
      break;
    }
    const double range = rays.range(from, along, kMax_m);
    (expected_m < kMax_m ? hits : misses) += 1;
    // A ridge thinner than the step may be passed, but never is anything met in the air.
    EXPECT_GT(range, expected_m - 2.0 * kTiny_m) << "ray " << i;
    late += range > expected_m + 2.0 * kTiny_m ? 1 : 0;
  }
  EXPECT_GT(hits, 200);
  EXPECT_GT(misses, 50);
  EXPECT_LE(late, 5);
}

TEST(GroundRays, LevelGroundIsMetExactly) {
  Terrain terrain;
  terrain.plates.push_back({{{10, -50}, {20, -50}, {20, 50}, {10, 50}}, -2.0});
  const GroundRays rays(terrain);
  const Eigen::Vector3d down = Eigen::Vector3d(1, 0, -0.1).normalized();
  EXPECT_NEAR(rays.range({0, 0, 0.5}, down, 30.0), 5.0 / down.x(), 1e-9) << "before the pit";
  EXPECT_NEAR(rays.range({12, 0, -1.8}, down, 30.0), 2.0 / down.x(), 1e-9) << "in the pit";
  // Over the near edge into the pit, and from the pit against its far wall.
  EXPECT_NEAR(
      rays.range({5, 0, 1.0}, Eigen::Vector3d(1, 0, -0.19).normalized(), 30.0),
      std::hypot(3.0 / 0.19, 3.0),
      0.9);
  EXPECT_NEAR(rays.range({12, 0, -1.0}, Eigen::Vector3d::UnitX(), 30.0), 8.0, 1e-3);
  EXPECT_EQ(rays.range({0, 0, 1.0}, Eigen::Vector3d::UnitX(), 30.0), 30.0);
  EXPECT_NEAR(rays.range({-40, 0, 1.0}, -Eigen::Vector3d::UnitZ(), 30.0), 1.0, 1e-9);
}

/// A plane that rises 0.2 m per metre to the east.
World slope() {
  World world;
  world.datum = {36.8, -2.4, 20.0};
  world.terrain.ramps.push_back({{-100, 0}, {100, 0}, 200.0, 0.0, 40.0});
  return world;
}
constexpr double kRise = 0.2;

SimParams withoutNoise() {
  SimParams params;
  params.robot.grip_left = params.robot.grip_right = 1.0;
  params.robot.slip_sigma = params.robot.side_slip = params.robot.burst_rate_hz = 0.0;
  params.imu.gyro = params.imu.accel = {};
  params.lidar.echo.sigma_m = params.lidar.echo.drop_out = params.lidar.echo.outliers = 0.0;
  params.lidar.echo.mixed_share = params.lidar.echo.grazing_rad = 0.0;
  return params;
}

TEST(OnASlope, AttitudeComesFromTheWheelsAndTheImuFeelsIt) {
  const double tilt_rad = std::atan(kRise);
  for (const double yaw_rad : {0.0, kPi / 2, kPi, 0.7}) {
    SCOPED_TRACE(yaw_rad);
    Simulator simulator(slope(), withoutNoise(), {3.0, 1.0, yaw_rad}, 1);
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    for (const Delivered& d : simulator.step(1s)) {
      if (const auto* imu = std::get_if<Imu>(&d.measurement)) force = imu->accel_mps2;
    }
    const Pose3& T = simulator.truth3();
    // Uphill to the east: the nose goes up facing east, the right side facing north.
    EXPECT_NEAR(T.pitch, -std::atan(kRise * std::cos(yaw_rad)), 1e-6);
    EXPECT_NEAR(T.roll, std::atan(-kRise * std::sin(yaw_rad)), 1e-6);
    EXPECT_NEAR(T.z, kRise * 103.0, 1e-6);
    // Standing still the accelerometer shows nothing but the vertical.
    EXPECT_NEAR(force.norm(), 9.80665, 1e-6);
    EXPECT_NEAR(std::acos(force.z() / force.norm()), tilt_rad, 2e-3);
    EXPECT_GT(force.x() * std::cos(yaw_rad), -1e-9) << "the nose is up when facing uphill";
  }
}

TEST(OnASlope, TheRobotDriftsDownhillAndLosesSpeedUphill) {
  SimParams params = withoutNoise();
  const auto drive = [&params](double yaw_rad) {
    Simulator simulator(slope(), params, {0.0, 0.0, yaw_rad}, 1);
    simulator.command(0.8, 0.0);
    (void)simulator.step(10s);
    return simulator.truth();
  };
  const double across_m = drive(kPi / 2).y;
  const double tilt_rad = std::atan(kRise);
  // The drift is counted in the plane of the wheels; seen from above it is shorter.
  EXPECT_NEAR(
      drive(kPi / 2).x,
      -params.robot.slope_side_slip * tilt_rad * across_m * std::cos(tilt_rad),
      0.02);
  EXPECT_GT(across_m, 7.0);
  const double up_m = drive(0.0).x;
  const double level_m = across_m;
  EXPECT_NEAR(
      up_m / level_m, (1.0 - params.robot.slope_slip * tilt_rad) * std::cos(tilt_rad), 0.005);
  EXPECT_NEAR(drive(0.0).y, 0.0, 0.02) << "straight up there is no side to drift to";
  params.robot.slope_side_slip = 0.0;
  EXPECT_NEAR(drive(kPi / 2).x, 0.0, 0.02);
}

TEST(OnASlope, TheLidarTiltsIntoTheGround) {
  // GIVEN a robot on a hump, its nose down towards a level yard
  World world;
  world.datum = {36.8, -2.4, 20.0};
  world.terrain.ramps.push_back({{-3, 0}, {3, 0}, 10.0, 0.6, -0.6});
  SimParams params = withoutNoise();
  params.lidar.beams = 3;
  params.lidar.field_of_view_rad = kPi;
  Simulator simulator(world, params, {0, 0, 0}, 1);
  // THEN its level beams ahead meet the ground where the tilted axis does
  std::vector<float> ranges;
  for (const Delivered& d : simulator.step(1s)) {
    if (const auto* scan = std::get_if<LaserScan>(&d.measurement)) ranges = scan->ranges_m;
  }
  ASSERT_EQ(ranges.size(), 3U);
  const double tilt_rad = std::atan(0.1);
  // The beam runs 0.4 m above the ramp and parallel to it, and beyond its foot into the yard.
  const double foot_m = (3.0 - 0.35 * std::cos(tilt_rad)) / std::cos(tilt_rad);
  const double beyond_m = 0.4 / std::tan(tilt_rad);
  EXPECT_NEAR(ranges[1], foot_m + beyond_m, 0.1);
  EXPECT_TRUE(std::isinf(ranges[0]) || ranges[0] > 20.0F) << "level to the side";
  // On level ground there is nothing to meet.
  world.terrain.ramps.clear();
  Simulator level(world, params, {0, 0, 0}, 1);
  for (const Delivered& d : level.step(1s)) {
    const auto* scan = std::get_if<LaserScan>(&d.measurement);
    EXPECT_TRUE(scan == nullptr || std::isinf(scan->ranges_m[1]));
  }
}

TEST(OnASlope, TheBodyFollowsAStepWithinItsSuspension) {
  World world;
  world.datum = {36.8, -2.4, 20.0};
  world.terrain.plates.push_back({{{2, -5}, {9, -5}, {9, 5}, {2, 5}}, 0.05});
  Simulator simulator(world, withoutNoise(), {0, 0, 0}, 1);
  simulator.command(0.5, 0.0);
  double highest_m = 0.0;
  double steepest_rad = 0.0;
  double largest_step_m = 0.0;
  double before_m = 0.0;
  for (int i = 0; i < 1200; ++i) {
    (void)simulator.step(5ms);
    const Pose3& T = simulator.truth3();
    highest_m = std::max(highest_m, T.z);
    steepest_rad = std::max(steepest_rad, -T.pitch);
    largest_step_m = std::max(largest_step_m, std::abs(T.z - before_m));
    before_m = T.z;
  }
  EXPECT_GT(simulator.truth().x, 2.5);
  EXPECT_NEAR(simulator.truth3().z, 0.05, 1e-3);
  EXPECT_LT(highest_m, 0.055) << "critically damped";
  EXPECT_GT(steepest_rad, 0.5 * std::atan(0.05 / 0.55)) << "front wheels up, rear wheels down";
  EXPECT_LT(largest_step_m, 0.005) << "no jump within 5 ms";
}

TEST(OnASlope, RoughGroundShakesTheRobotByItsRoughness) {
  World world;
  world.datum = {36.8, -2.4, 20.0};
  world.ground.roughness_m = 0.02;
  const auto shaken = [&world](double roughness_m) {
    world.ground.roughness_m = roughness_m;
    Simulator simulator(world, withoutNoise(), {0, 0, 0}, 1);
    simulator.command(0.5, 0.0);
    Moments roll;
    for (int i = 0; i < 600; ++i) {
      (void)simulator.step(50ms);
      roll.add(simulator.truth3().roll);
    }
    return roll.rms();
  };
  EXPECT_EQ(shaken(0.0), 0.0);
  EXPECT_GT(shaken(0.02), 0.005);
  EXPECT_NEAR(shaken(0.02) / shaken(0.01), 2.0, 0.1);
}

}  // namespace
}  // namespace vestibule::sim
