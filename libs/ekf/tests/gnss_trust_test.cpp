// What the filter believes when sensors err more than they say.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dead_reckoning.hpp"
#include "noise_scale.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/ekf/filter.hpp"

namespace vestibule::ekf {
namespace {

Timestamp at(double seconds) { return Timestamp{0} + durationFromSeconds(seconds); }

/// Feeds squared errors of `ratio` times the claim for `seconds` at 5 Hz from `begin_s` on.
void feed(NoiseScale& noise, double begin_s, double seconds, double ratio) {
  for (int i = 0; i < static_cast<int>(5.0 * seconds); ++i) {
    noise.note(at(begin_s + 0.2 * i), ratio);
  }
}

TEST(NoiseScale, FollowsTheErrorsSlowlyAndForgetsThem) {
  const FilterParams params;
  NoiseScale noise(params);
  EXPECT_EQ(noise.value(), 1.0);
  feed(noise, 0.0, 5.0, 4.0);
  EXPECT_LT(noise.value(), 1.5) << "5 of 60 s";
  feed(noise, 5.0, 300.0, 4.0);
  EXPECT_NEAR(noise.value(), 4.0, 0.2);
  feed(noise, 305.0, 300.0, 0.5);
  EXPECT_EQ(noise.value(), 1.0) << "claims are floors";
}

TEST(NoiseScale, IsBoundedAndASpikeIsNoNoise) {
  const FilterParams params;
  NoiseScale noise(params);
  feed(noise, 0.0, 10.0, 1.0);
  noise.note(at(10.2), 1e9);
  EXPECT_LT(noise.value(), 1.1);
  feed(noise, 11.0, 2000.0, 1e6);
  EXPECT_NEAR(noise.value(), params.gnss.adapt_most, 1e-6);
  noise.note(at(3000.0), std::nan(""));
  EXPECT_NEAR(noise.value(), params.gnss.adapt_most, 1e-6);
}

/// An RTK robot drives a large circle; from 60 s on its gyro is off by half a degree per second.
TEST(MapFilter, AGyroBiasThatStepsIsNoticedByCarrierPhaseFixes) {
  MapFilter filter{FilterParams(), SensorRig()};
  RandomStream random(1, "bias step");
  Pose2 truth;
  double worst_m = 0.0;
  int refused_in_a_row = 0;
  int longest = 0;
  for (int i = 1; i <= 120 * 50; ++i) {
    const double t = 0.02 * i;
    const Pose2 step = expSe2({0.02, 0.0, 0.05 * 0.02});
    truth = compose(truth, step);
    Imu imu;
    imu.stamp = at(t);
    imu.omega_radps.z() = 0.05 + random.normal(0.0, 0.002) + (t > 60.0 ? degToRad(0.5) : 0.0);
    (void)filter.process(imu);
    (void)filter.process(WheelOdometry{at(t), 0.02, step});
    if (i % 10 != 0) continue;
    MapFix fix;
    fix.stamp = at(t);
    fix.type = GnssFixType::kRtkFixed;
    fix.p_map_antenna = {
        truth.x + random.normal(0.0, 0.02), truth.y + random.normal(0.0, 0.02), 0.0};
    const UpdateReport report = filter.process(fix);
    if (t < 40.0) continue;
    refused_in_a_row = report.decision == Decision::kGated ? refused_in_a_row + 1 : 0;
    longest = std::max(longest, refused_in_a_row);
    worst_m = std::max(worst_m, distance(filter.pose().mean, truth));
  }
  EXPECT_LT(worst_m, 0.5);
  EXPECT_LE(longest, 10) << "fixes in a row, 5 per second";
  EXPECT_NEAR(filter.state().gyro_bias.z(), degToRad(0.5), degToRad(0.3));
}

TEST(DeadReckoning, TakesOutWhatTurningDoesToAnAccelerometerBesideTheBase) {
  FilterParams params;
  params.plane = false;
  params.accel.position_m = {0.4, -0.2, 0.3};
  DeadReckoning reckoning(params);
  const Eigen::Vector3d lever(0.4, -0.2, 0.3);
  const Eigen::Vector3d gravity(0.0, 0.0, 9.81);
  const Eigen::Vector3d angular(0.1, -0.3, 0.8);  // [rad/s^2]
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d omega = Eigen::Vector3d(0.2, 0.1, 0.5) + 0.01 * i * angular;
    Imu imu;
    imu.stamp = at(0.01 * i);
    imu.omega_radps = omega;
    imu.accel_mps2 = gravity + omega.cross(omega.cross(lever)) + angular.cross(lever);
    (void)reckoning.process(imu, Eigen::Vector3d::Zero());
    if (i > 1) {
      EXPECT_LT((reckoning.force() - gravity).norm(), 1e-9);
      EXPECT_GT((imu.accel_mps2 - gravity).norm(), 0.2) << "what it would be without";
    }
  }
}

}  // namespace
}  // namespace vestibule::ekf
