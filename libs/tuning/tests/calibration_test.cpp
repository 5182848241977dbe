#include "vestibule/tuning/calibration.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scenario_log.hpp"
#include "test_files.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/pipeline/fuse.hpp"

namespace vestibule::tuning {
namespace {

using testing::HasSubstr;
using vestibule::test::recordScenario;
using vestibule::test::shipped;
using vestibule::test::shippedScenario;
using vestibule::test::TempFolder;

/// A drive by formula: wheels of a known geometry, with noise, and the truth.
struct Formula {
  std::vector<WheelOdometry> odometry;
  metrics::Trajectory truth;
};

Formula driven(
    const WheelGeometry& g, double track_m, const std::function<Eigen::Vector2d(double)>& v_w) {
  Formula f;
  RandomStream random(5, "wheels");
  Pose2 T;
  constexpr double kDt_s = 0.05;
  for (int i = 0; i <= 4000; ++i) {
    const Timestamp stamp{static_cast<std::int64_t>(i) * 50'000'000};
    WheelOdometry m;
    m.stamp = stamp;
    m.dt_s = kDt_s;
    if (i > 0) {
      const Eigen::Vector2d vw = v_w(kDt_s * i);
      T = compose(T, expSe2({kDt_s * vw.x(), -kDt_s * vw.y() * g.icr_x_m, kDt_s * vw.y()}));
      const double V_l = (vw.x() - vw.y() * g.icr_left_m) / g.scale_left;
      const double V_r = (vw.x() - vw.y() * g.icr_right_m) / g.scale_right;
      const double noise = 1.0 + 0.02 * random.normal();
      m.T_previous_now =
          expSe2({0.5 * kDt_s * (V_l + V_r) * noise, 0.0, kDt_s * (V_r - V_l) / track_m * noise});
    }
    f.odometry.push_back(m);
    f.truth.push_back({stamp, T});
  }
  return f;
}

Eigen::Vector2d everything(double t_s) {
  const int phase = static_cast<int>(t_s / 10.0) % 4;
  return phase == 0   ? Eigen::Vector2d(0.8, 0.0)
         : phase == 1 ? Eigen::Vector2d(0.0, 0.7)
         : phase == 2 ? Eigen::Vector2d(-0.6, 0.3)
                      : Eigen::Vector2d(0.0, -0.7);
}

constexpr double kTrack_m = 0.6;
const WheelGeometry kGeometry{0.97, 0.99, 0.46, -0.44, 0.05};

/// Headings along a path that bends as `turn_radps` says, with a known deviation and passing steel.
Calibration compassOver(
    const std::function<double(double)>& turn_radps, const CompassDeviation& d) {
  RandomStream random(7, "compass");
  metrics::Trajectory path;
  std::vector<Heading> readings;
  Pose2 T;
  for (int i = 0; i <= 600; ++i) {
    const Timestamp stamp{static_cast<std::int64_t>(i) * 1'000'000'000};
    if (i > 0) T = compose(T, expSe2({1.0, 0.0, turn_radps(i)}));
    path.push_back({stamp, T});
    const double bearing = yawFromBearing(T.phi);
    double reading = bearing;
    for (int k = 0; k < 20; ++k) reading = bearing + d.at(reading);
    const bool steel = i / 20 % 5 == 0;
    Heading heading;
    heading.stamp = stamp;
    heading.yaw_rad =
        yawFromBearing(reading + degToRad(steel ? 40.0 : 0.0) + degToRad(1.5) * random.normal());
    readings.push_back(heading);
  }
  return calibrateCompass(readings, path, {});
}

TEST(CalibrateCompass, RecoversTheDeviation) {
  CompassDeviation d;
  d.coefficients_deg = {7.0, 4.0, -2.0, 5.0, 1.0};
  const Calibration c = compassOver([](double t) { return t < 300 ? 0.05 : -0.07; }, d);
  ASSERT_EQ(c.quantities.size(), 5U);
  for (std::size_t i = 0; i < 5; ++i) {
    const Quantity& q = c.quantities[i];
    EXPECT_EQ(q.unobserved, "") << q.name;
    // A fifth of the readings stands beside steel.
    EXPECT_NEAR(q.value, d.coefficients_deg[i], 1.0) << q.name << " +- " << q.sigma;
    EXPECT_LT(std::abs(q.value - d.coefficients_deg[i]), 4.0 * q.sigma) << q.name;
  }
  EXPECT_LT(c.residuals[0].rmsAfter(), c.residuals[0].rmsBefore());
}

TEST(CalibrateCompass, AMountingTheWrongWayRoundIsFound) {
  CompassDeviation d;
  d.coefficients_deg = {178.0, 4.0, -2.0, 5.0, 1.0};
  const Calibration c = compassOver([](double t) { return t < 300 ? 0.05 : -0.07; }, d);
  EXPECT_NEAR(std::abs(c.quantities[0].value), 178.0, 1.0);
  for (std::size_t i = 1; i < 5; ++i) {
    EXPECT_NEAR(c.quantities[i].value, d.coefficients_deg[i], 1.0) << c.quantities[i].name;
  }
}

TEST(CalibrateCompass, SaysWhatToDriveAfterOneStraight) {
  CompassDeviation d;
  d.coefficients_deg = {7.0, 4.0, -2.0, 5.0, 1.0};
  const Calibration c = compassOver([](double) { return 0.0; }, d);
  EXPECT_THAT(c.quantities[1].unobserved, HasSubstr("all directions"));
}

TEST(CalibrateOdometry, RecoversKnownWheels) {
  const Formula f = driven(kGeometry, kTrack_m, everything);
  const OdometryCalibration c = calibrateOdometry(f.odometry, f.truth, true, kTrack_m);
  EXPECT_NEAR(c.wheels.scale_left, kGeometry.scale_left, 0.003);
  EXPECT_NEAR(c.wheels.scale_right, kGeometry.scale_right, 0.003);
  EXPECT_NEAR(c.wheels.icr_left_m, kGeometry.icr_left_m, 0.01);
  EXPECT_NEAR(c.wheels.icr_right_m, kGeometry.icr_right_m, 0.01);
  EXPECT_NEAR(c.wheels.icr_x_m, kGeometry.icr_x_m, 0.01);
  ASSERT_EQ(c.residuals.size(), 1U);
  EXPECT_LT(c.residuals[0].rmsAfter(), 0.1 * c.residuals[0].rmsBefore());
  for (const Quantity& q : c.quantities) EXPECT_EQ(q.unobserved, "") << q.name;
  ASSERT_TRUE(c.quick_scale && c.quick_track_m);
  EXPECT_NEAR(*c.quick_scale, 0.98, 0.01);
  EXPECT_NEAR(*c.quick_track_m, 0.90, 0.02);
  EXPECT_NEAR(c.umbmark.wheel_ratio, 0.99 / 0.97, 0.004);
  EXPECT_NEAR(c.umbmark.track_ratio, 0.90 / 0.6, 0.02);
}

TEST(CalibrateOdometry, AStraightDriveDoesNotShowTheTrack) {
  const Formula f = driven(kGeometry, kTrack_m, [](double t_s) {
    // Kept straight: the wheels claim a slight turn that is none.
    return Eigen::Vector2d(0.8 + 0.1 * std::sin(t_s), 0.0);
  });
  const OdometryCalibration c = calibrateOdometry(f.odometry, f.truth, true, kTrack_m);
  EXPECT_EQ(c.find("left wheel scale")->unobserved, "");
  EXPECT_NEAR(c.wheels.scale_left, kGeometry.scale_left, 0.003);
  EXPECT_THAT(c.find("effective track")->unobserved, HasSubstr("turn on the spot"));
  EXPECT_THAT(c.find("ICR ahead of base")->unobserved, HasSubstr("turn on the spot"));
}

TEST(CalibrateOdometry, WithoutPositionsOnlyTheTrackIsFound) {
  const Formula f = driven({1.0, 1.0, 0.45, -0.45, 0.0}, kTrack_m, everything);
  const OdometryCalibration c = calibrateOdometry(f.odometry, f.truth, false, kTrack_m);
  EXPECT_EQ(c.find("effective track")->unobserved, "");
  EXPECT_NEAR(c.find("effective track")->value, 0.9, 0.01);
  EXPECT_THAT(c.find("left wheel scale")->unobserved, HasSubstr("no position"));
}

TEST(CalibrateOdometry, TooShortADriveIsRefused) {
  Formula f = driven(kGeometry, kTrack_m, everything);
  f.odometry.resize(200);
  EXPECT_THROW((void)calibrateOdometry(f.odometry, f.truth, true, kTrack_m), InputError);
}

/// Within the bar, and within three of the claimed standard deviations.
void expectCovered(const Calibration& c, const char* name, double truth, double bar) {
  const Quantity* q = c.find(name);
  ASSERT_NE(q, nullptr) << name;
  EXPECT_EQ(q->unobserved, "") << name;
  EXPECT_NEAR(q->value, truth, bar) << name;
  EXPECT_LT(std::abs(q->value - truth), 3.0 * q->sigma) << name << " = " << q->value;
}

/// The shipped drive, so many times over; the laser has a test of its own.
auto calibrationDrive(int repeat) {
  auto scenario = shippedScenario("calibration_drive");
  scenario.sim.lidar.rate_hz = 0.1;
  scenario.repeat = repeat;
  return scenario;
}

/// Bars: ICR 1.5 x track and 3 % scale within 2 %, 80 ms latency within 10 ms, 0.4 m lever arm
/// within 0.05 m, all on one simulated drive; the lever arm and the latency are not known
/// beforehand.
TEST(Calibrate, ASimulatedDriveGivesItsRobotBack) {
  const TempFolder folder;
  const std::string log = folder / "drive.rawlog";
  const metrics::Trajectory truth = recordScenario(calibrationDrive(2), 1, log);
  pipeline::Config config = pipeline::loadConfig(shipped("config/filters/simulated_robot.yaml"));
  io::RecordingOptions options;
  const auto quiet = [](double, double) {};
  OdometryData data = readOdometry(log, "", options, config, quiet);
  const OdometryCalibration by_gnss =
      calibrateOdometry(data.odometry, data.reference, data.has_position, 0.75, data.errors);
  const OdometryCalibration by_truth = calibrateOdometry(data.odometry, truth, true, 0.75);
  for (const OdometryCalibration* c : {&by_gnss, &by_truth}) {
    EXPECT_NEAR(c->find("effective track")->value, 1.125, 0.02 * 1.125);
    EXPECT_NEAR(c->find("effective track")->value, 1.125, 3.0 * c->find("effective track")->sigma);
    EXPECT_NEAR(c->wheels.scale_left, 1.0 / 1.03, 0.02);
    EXPECT_NEAR(c->wheels.scale_right, 1.0 / 1.03, 0.02);
  }
  const Calibration mount = calibrateMount(log, options, config, quiet);
  EXPECT_NEAR(mount.find("antenna x")->value, 0.4, 0.05);
  EXPECT_NEAR(mount.find("antenna y")->value, 0.0, 0.05);
  EXPECT_NEAR(mount.find("gnss stamps late by")->value, 0.08, 0.01);
  EXPECT_NEAR(mount.find("IMU yaw")->value, 0.0, 1.0);
  const OffsetsCalibration offsets = calibrateOffsets(log, options, config, false, quiet);
  expectCovered(offsets, "gnss stamps late by", 0.08, 0.01);
  expectCovered(offsets, "wheels stamps late by", 0.0, 0.005);
  expectCovered(offsets, "antenna x", 0.4, 0.05);
}

/// The lever arm is unknown and both sensors are late: each is told from the others.
TEST(CalibrateOffsets, LateWheelsAndLateFixesAreToldApart) {
  const TempFolder folder;
  const std::string log = folder / "drive.rawlog";
  auto scenario = calibrationDrive(2);
  scenario.sim.transport.wheels.clock_offset_s = 0.12;
  recordScenario(scenario, 2, log);
  const pipeline::Config config =
      pipeline::loadConfig(shipped("config/filters/simulated_robot.yaml"));
  const OffsetsCalibration c = calibrateOffsets(log, {}, config, false, [](double, double) {});
  expectCovered(c, "wheels stamps late by", 0.12, 0.005);
  expectCovered(c, "gnss stamps late by", 0.08, 0.01);
}

TEST(CalibrateOffsets, AStraightDriveDoesNotShowTheWheelsDelay) {
  const TempFolder folder;
  const std::string log = folder / "drive.rawlog";
  auto scenario = calibrationDrive(3);
  scenario.drive.resize(1);
  recordScenario(scenario, 1, log);
  const OffsetsCalibration c =
      calibrateOffsets(log, {}, pipeline::Config{}, false, [](double, double) {});
  EXPECT_THAT(c.find("wheels stamps late by")->unobserved, HasSubstr("turn on the spot"));
  EXPECT_THAT(c.find("antenna x")->unobserved, HasSubstr("turn on the spot"));
}

}  // namespace
}  // namespace vestibule::tuning
