#include "heading_bank.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/ekf/filter.hpp"

namespace vestibule::ekf {
namespace {

constexpr double kSigma_mps = 0.1;

/// Velocities of a robot that drives on at 1 m/s, its wheels over-counting, its course changing.
struct Course {
  double yaw_map_odom_rad;
  RandomStream random;
  int index = 0;

  void drive(HeadingBank& bank, double forward_mps) {
    const double course = 0.1 * index++;
    const Eigen::Vector2d v_odom(forward_mps * std::cos(course), forward_mps * std::sin(course));
    const double turned = course + yaw_map_odom_rad;
    const double true_mps = 0.95 * forward_mps;
    const Eigen::Vector2d v_map(
        true_mps * std::cos(turned) + random.normal(0.0, kSigma_mps),
        true_mps * std::sin(turned) + random.normal(0.0, kSigma_mps));
    bank.add(v_map, v_odom, kSigma_mps);
  }
};

TEST(HeadingBank, FindsAnyYawWithinWhatItClaims) {
  // 72 yaws, forwards and backwards; a normal error exceeds three sigma once in 370.
  const FilterParams params;
  int beyond = 0;
  for (int i = 0; i < 72; ++i) {
    Course course{wrapToPi(degToRad(5.0 * i)), RandomStream(1, "bank", static_cast<unsigned>(i))};
    HeadingBank bank(params);
    std::optional<HeadingBank::Result> found;
    for (int k = 0; k < 20 && !found; ++k) {
      course.drive(bank, i % 2 == 0 ? 1.0 : -1.0);
      found = bank.solve();
    }
    ASSERT_TRUE(found) << 5 * i << " deg";
    EXPECT_LT(found->sigma_rad, params.init.max_yaw_sigma_rad);
    const double off = std::abs(angleDiff(found->yaw_map_odom_rad, course.yaw_map_odom_rad));
    if (off > 3.0 * found->sigma_rad) ++beyond;
  }
  EXPECT_LE(beyond, 1);
}

TEST(HeadingBank, SaysNothingOfARobotThatStands) {
  const FilterParams params;
  HeadingBank bank(params);
  RandomStream random(2, "bank");
  for (int k = 0; k < 100; ++k) {
    bank.add({random.normal(0.0, 0.1), random.normal(0.0, 0.1)}, {0.0, 0.0}, kSigma_mps);
  }
  EXPECT_EQ(bank.size(), 0);
  EXPECT_FALSE(bank.solve());
}

TEST(HeadingBank, DoesNotBelieveVelocitiesThatDoNotTurnWithTheRobot) {
  // Under a roof: a receiver that says the same whatever the robot does.
  const FilterParams params;
  HeadingBank bank(params);
  for (int k = 0; k < 60; ++k) {
    bank.add({0.8, 0.2}, {std::cos(0.3 * k), std::sin(0.3 * k)}, kSigma_mps);
    if (k > 15) {
      EXPECT_FALSE(bank.solve()) << k;
    }
  }
}

/// Wheels, gyro and a receiver with velocity: which way the robot looks is known after a metre.
TEST(MapFilterVelocity, StartsWithinAMetreAndABitAndKeepsItsHeading) {
  SensorRig rig;
  rig.p_base_antenna = {-0.6, 0.4};
  RandomStream random(3, "velocity");
  for (const double speed : {1.0, -1.0}) {
    MapFilter filter{FilterParams(), rig};
    Pose2 truth(10.0, -5.0, 2.0);
    double ready_after_m = 0.0;
    double worst_rad = 0.0;
    for (int i = 1; i <= 60 * 50; ++i) {
      const double rate = 0.4 * std::sin(0.01 * i);
      const Pose2 step = expSe2({speed * 0.02, 0.0, rate * 0.02});
      truth = compose(truth, step);
      const Timestamp now = Timestamp{0} + std::chrono::milliseconds(20) * i;
      Imu imu;
      imu.stamp = now;
      imu.omega_radps.z() = rate + 0.003;
      (void)filter.process(imu);
      (void)filter.process(WheelOdometry{now, 0.02, step});
      if (i % 10 != 0) continue;
      const Point2 antenna = transform(truth, rig.p_base_antenna);
      const Point2 swing = transform(
          Pose2(0, 0, truth.phi),
          {speed - rate * rig.p_base_antenna.y, rate * rig.p_base_antenna.x});
      MapFix fix;
      fix.stamp = now;
      fix.type = GnssFixType::kSingle;
      fix.p_map_antenna = {antenna.x + 2.0, antenna.y - 1.0, 0.0};  // errors of a minute's memory
      fix.velocity = GnssVelocity{
          {swing.x + random.normal(0.0, 0.05), swing.y + random.normal(0.0, 0.05), 0.0}, 0.05};
      (void)filter.process(fix);
      if (!filter.ready()) continue;
      if (ready_after_m == 0.0) ready_after_m = 0.02 * i;
      if (i > 1000) {
        worst_rad = std::max(worst_rad, std::abs(angleDiff(filter.pose().mean.phi, truth.phi)));
      }
    }
    EXPECT_GT(ready_after_m, 0.0);
    EXPECT_LT(ready_after_m, 3.0) << "speed " << speed;
    EXPECT_LT(worst_rad, degToRad(3.0)) << "speed " << speed;
  }
}

TEST(MapFilterVelocity, AFarOneIsRefusedAndAllAreCounted) {
  struct Counter : Observer {
    std::map<std::string, int> by_reason;
    void onUpdate(const UpdateEvent& event) override {
      if (event.sensor == "gnss_velocity") ++by_reason[event.reason];
    }
  } counter;
  Observers observers;
  observers.attach(counter);
  FilterParams params;
  MapFilter filter(params, SensorRig(), &observers);
  PoseWithCovariance start{Pose2(0, 0, 0), 0.01 * Eigen::Matrix3d::Identity()};
  filter.reset(Timestamp{0}, start);
  double yaw_before = 0.0;
  for (int i = 1; i <= 100; ++i) {
    const Timestamp now = Timestamp{0} + std::chrono::milliseconds(100) * i;
    (void)filter.process(WheelOdometry{now, 0.1, Pose2(0.1, 0, 0)});
    MapFix fix;
    fix.stamp = now;
    fix.type = GnssFixType::kSingle;
    fix.p_map_antenna = {0.1 * i, 0.0, 0.0};
    fix.velocity = GnssVelocity{{1.0, 0.0, 0.0}, 0.05};
    if (i == 80) {
      yaw_before = filter.pose().mean.phi;
      fix.velocity->enu_mps = {-3.0, 4.0, 0.0};
    }
    if (i == 90) fix.velocity->enu_mps.x() = std::nan("");
    (void)filter.process(fix);
    if (i == 80) {
      EXPECT_NEAR(filter.pose().mean.phi, yaw_before, 1e-3);
    }
  }
  EXPECT_EQ(counter.by_reason["chi2"], 1);
  EXPECT_EQ(counter.by_reason["not finite"], 1);
  EXPECT_EQ(filter.dropped().at("not finite"), 1U);
}

}  // namespace
}  // namespace vestibule::ekf
