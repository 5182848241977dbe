#include "vestibule/sim/simulator.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::sim {
namespace {

using namespace std::chrono_literals;

World yard() {
  World world;
  world.datum = {36.8, -2.4, 20.0};
  world.walls.push_back({"", {{-10, -10}, {20, -10}, {20, 10}, {-10, 10}}, true});
  world.boxes.push_back({"", {8.0, 3.0}, 2.0, 1.0, 0.3});
  world.buildings.push_back({{"shed", {{12, -10}, {20, -10}, {20, 0}, {12, 0}}}, true, 4.0, {}});
  return world;
}

/// Every bit of a measurement as text.
struct Printer {
  std::ostringstream& out;
  void operator()(const WheelOdometry& m) const {
    out << "wheels " << m.stamp.ns << ' ' << m.T_previous_now.x << ' ' << m.T_previous_now.y << ' '
        << m.T_previous_now.phi << '\n';
  }
  void operator()(const Imu& m) const {
    out << "imu " << m.stamp.ns << ' ' << m.omega_radps.transpose() << ' '
        << m.accel_mps2.transpose() << '\n';
  }
  void operator()(const Heading& m) const { out << "heading " << m.stamp.ns << '\n'; }
  void operator()(const GnssFix& m) const {
    const auto& p = std::get<Geodetic>(m.position);
    out << "gnss " << m.stamp.ns << ' ' << toString(m.type) << ' ' << p.lat_deg << ' ' << p.lon_deg
        << ' ' << p.height_m << '\n';
  }
  void operator()(const LaserScan& m) const {
    out << "lidar " << m.stamp.ns;
    for (const float r : m.ranges_m) out << ' ' << r;
    out << '\n';
  }
};

struct Record {
  std::string wheels, imu, compass, gnss, lidar, truth;
};

Record record(const SimParams& params, std::uint64_t seed) {
  Simulator simulator(yard(), params, {0, 0, 0.2}, seed);
  Record record;
  std::ostringstream truth;
  truth.precision(17);
  for (int i = 0; i < 200; ++i) {
    simulator.command(0.6, i < 100 ? 0.3 : -0.4);
    for (const Delivered& delivered : simulator.step(20ms)) {
      const Measurement& m = delivered.measurement;
      std::ostringstream out;
      out.precision(17);
      std::visit(Printer{out}, m);
      std::string* const texts[] = {
          &record.wheels, &record.imu, &record.compass, &record.gnss, &record.lidar};
      *texts[m.index()] += out.str();
    }
    truth << simulator.truth().x << ' ' << simulator.truth().y << ' ' << simulator.truth().phi
          << '\n';
  }
  record.truth = truth.str();
  return record;
}

TEST(Simulator, RepeatsItselfBitForBit) {
  const SimParams params;
  const Record a = record(params, 5);
  const Record b = record(params, 5);
  EXPECT_EQ(a.truth, b.truth);
  EXPECT_EQ(a.wheels, b.wheels);
  EXPECT_EQ(a.imu, b.imu);
  EXPECT_EQ(a.gnss, b.gnss);
  EXPECT_EQ(a.lidar, b.lidar);
  const Record other = record(params, 6);
  EXPECT_NE(a.truth, other.truth);
  EXPECT_NE(a.imu, other.imu);
  EXPECT_NE(a.gnss, other.gnss);
  EXPECT_NE(a.lidar, other.lidar);
}

TEST(Simulator, SensorsDoNotDisturbEachOther) {
  SimParams params;
  const Record a = record(params, 5);
  params.lidar.beams = 91;
  params.gnss.receiver = GnssClass::kSingle;
  params.compass.enabled = true;
  const Record b = record(params, 5);
  EXPECT_EQ(a.truth, b.truth);
  EXPECT_EQ(a.wheels, b.wheels);
  EXPECT_EQ(a.imu, b.imu);
  EXPECT_NE(a.gnss, b.gnss);
  EXPECT_NE(a.lidar, b.lidar);
}

TEST(Simulator, AFurtherSensorChangesNoOther) {
  SimParams params;
  const Record without = record(params, 5);
  params.compass.enabled = true;
  params.ring_lidar.enabled = true;
  params.ring_lidar.azimuths = 90;
  const Record with = record(params, 5);
  EXPECT_TRUE(without.compass.empty());
  EXPECT_FALSE(with.compass.empty());
  EXPECT_EQ(without.truth, with.truth);
  EXPECT_EQ(without.wheels, with.wheels);
  EXPECT_EQ(without.imu, with.imu);
  EXPECT_EQ(without.gnss, with.gnss);
  EXPECT_EQ(without.lidar, with.lidar);
}

TEST(Simulator, DeliversEverySensorAtItsRateInOrder) {
  Simulator simulator(yard(), SimParams{}, {}, 1);
  std::vector<int> counts(std::variant_size_v<Measurement>);
  Timestamp last = kStartOfTime;
  for (int i = 0; i < 20; ++i) {
    for (const Delivered& delivered : simulator.step(50ms)) {
      const Measurement& m = delivered.measurement;
      ++counts[m.index()];
      EXPECT_GE(delivered.arrival, last);
      EXPECT_LE(delivered.arrival, simulator.time());
      EXPECT_LE(stampOf(m), delivered.arrival);
      last = delivered.arrival;
    }
  }
  EXPECT_EQ(simulator.time(), kStartOfTime + 1s);
  EXPECT_THAT(counts, ::testing::ElementsAre(50, 100, 0, 5, 10));
}

TEST(Simulator, GyroAndAccelerometerFeelTheTrueMotion) {
  SimParams params;
  params.imu = {};
  params.imu.gyro = params.imu.accel = {};
  params.imu.p_base_imu = {0.0, 0.0, 0.0};
  Simulator simulator(yard(), params, {}, 1);
  simulator.command(0.8, 0.5);
  double turn_rad = 0.0;
  Eigen::Vector3d v_map = Eigen::Vector3d::Zero();
  double yaw_rad = 0.0;
  for (int i = 0; i < 300; ++i) {
    for (const Delivered& delivered : simulator.step(10ms)) {
      const Measurement& m = delivered.measurement;
      if (const auto* imu = std::get_if<Imu>(&m)) {
        turn_rad += 0.01 * imu->omega_radps.z();
        // Integrate the specific force in map axes: it must give the velocity back.
        const double mid_rad = 0.5 * (yaw_rad + turn_rad);
        v_map.x() += 0.01 * (std::cos(mid_rad) * imu->accel_mps2.x() -
                             std::sin(mid_rad) * imu->accel_mps2.y());
        v_map.y() += 0.01 * (std::sin(mid_rad) * imu->accel_mps2.x() +
                             std::cos(mid_rad) * imu->accel_mps2.y());
        yaw_rad = turn_rad;
      }
    }
  }
  EXPECT_NEAR(angleDiff(turn_rad, simulator.truth().phi), 0.0, 1e-9);
  const Eigen::Vector3d v_base = simulator.trueTwist();
  EXPECT_GT(v_base.x(), 0.7);
  EXPECT_NEAR(v_map.x(), std::cos(yaw_rad) * v_base.x() - std::sin(yaw_rad) * v_base.y(), 0.005);
  EXPECT_NEAR(v_map.y(), std::sin(yaw_rad) * v_base.x() + std::cos(yaw_rad) * v_base.y(), 0.005);
}

TEST(Simulator, GnssMeasuresTheAntennaAndTheLidarItsOwnPlace) {
  SimParams params;
  params.rig.p_base_antenna = {1.0, 2.0};
  params.rig.T_base_laser = {0.5, 0.0, kPi / 2};
  params.gnss.fixed_sigma_m = 1e-6;
  params.lidar.echo.sigma_m = params.lidar.echo.drop_out = params.lidar.echo.outliers = 0.0;
  params.lidar.beams = 3;
  params.lidar.field_of_view_rad = kPi;
  Simulator simulator(yard(), params, {1.0, 0.0, kPi / 2}, 1);
  for (const Delivered& delivered : simulator.step(200ms)) {
    const Measurement& m = delivered.measurement;
    if (const auto* fix = std::get_if<GnssFix>(&m)) {
      const Eigen::Vector3d enu =
          geo::TangentPlane(yard().datum).toEnu(std::get<Geodetic>(fix->position));
      EXPECT_NEAR(enu.x(), -1.0, 1e-4);
      EXPECT_NEAR(enu.y(), 1.0, 1e-4);
    }
    if (const auto* scan = std::get_if<LaserScan>(&m)) {
      // The laser stands at (1, 0.5) and looks west; the beams go north, west and south.
      EXPECT_NEAR(scan->ranges_m[0], 9.5, 1e-5);
      EXPECT_NEAR(scan->ranges_m[1], 11.0, 1e-5);
      EXPECT_NEAR(scan->ranges_m[2], 10.5, 1e-5);
    }
  }
}

TEST(Simulator, StopsAtAWallAndRemembersIt) {
  SimParams params;
  Simulator simulator(yard(), params, {-8.0, 0.0, kPi}, 1);
  EXPECT_NEAR(simulator.minClearance(), 1.505, 1e-9);
  simulator.command(0.5, 0.0);
  (void)simulator.step(2s);
  EXPECT_FALSE(simulator.collided());
  EXPECT_LT(simulator.minClearance(), 1.0);
  EXPECT_GT(simulator.minClearance(), 0.4);
  (void)simulator.step(3s);
  EXPECT_TRUE(simulator.collided());
  EXPECT_EQ(simulator.minClearance(), 0.0);
  EXPECT_GT(simulator.truth().x, -9.6) << "drove through the wall";
  simulator.command(-0.5, 0.0);
  (void)simulator.step(4s);
  EXPECT_GT(simulator.truth().x, -8.5) << "cannot leave the wall";
  EXPECT_TRUE(simulator.collided()) << "forgot the collision";
}

TEST(SimParams, RejectsARateThatDoesNotFitTheTruth) {
  try {
    (void)parseParams<SimParams>("lidar: {rate_hz: 15}\ngnss: {receiver: rkt}\n", "sim.yaml");
    FAIL() << "accepted";
  } catch (const ConfigError& e) {
    EXPECT_THAT(e.what(), ::testing::HasSubstr("sim.yaml:1: lidar.rate_hz: must divide 200 Hz"));
    EXPECT_THAT(e.what(), ::testing::HasSubstr("sim.yaml:2: gnss.receiver"));
  }
}

}  // namespace
}  // namespace vestibule::sim
