#include "vestibule/sim/sensor_models.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::sim {
namespace {

struct Moments {
  int n = 0;
  double sum = 0.0;
  double sum2 = 0.0;
  void add(double v) {
    ++n;
    sum += v;
    sum2 += v * v;
  }
  [[nodiscard]] double mean() const { return sum / n; }
  [[nodiscard]] double sigma() const { return std::sqrt(sum2 / n - mean() * mean()); }
  [[nodiscard]] double rms() const { return std::sqrt(sum2 / n); }
};

Timestamp at(double seconds) { return timestampFromSeconds(1.7e9) + durationFromSeconds(seconds); }

TEST(Lidar, HasTheStatedNoiseDropOutsAndOutliers) {
  World world;
  world.walls.push_back({"", {{-5, -5}, {5, -5}, {5, 5}, {-5, 5}}, true});
  const WorldGeometry geometry(world);
  const LidarParams params;
  const Pose2 T_map_base{0.4, -0.3, 0.7};
  const Pose2 T_base_laser{0.35, 0.0, 0.1};
  const Pose2 T_map_laser = compose(T_map_base, T_base_laser);
  Moments error;
  int missing = 0;
  int short_echo = 0;
  int total = 0;
  for (std::uint64_t k = 0; k < 200; ++k) {
    const LaserScan scan = simulateScan(geometry, params, T_map_base, T_base_laser, at(0), 3, k);
    ASSERT_EQ(scan.ranges_m.size(), 361U);
    for (std::size_t i = 0; i < scan.ranges_m.size(); ++i, ++total) {
      const double truth_m = geometry.castRay(
          {T_map_laser.x, T_map_laser.y}, T_map_laser.phi + scan.angle(i), params.range_max_m);
      if (!scan.valid(i)) {
        ++missing;
      } else if (std::abs(scan.ranges_m[i] - truth_m) > 0.15) {
        ++short_echo;
        EXPECT_LT(scan.ranges_m[i], truth_m);
      } else {
        error.add(scan.ranges_m[i] - truth_m);
      }
    }
  }
  // 72200 beams: 5 sigma of the mean is 0.0004 m, of sigma 1.3 %, of a 0.5 % share 0.13 %. About
  // 5 % of the short echoes end too near the wall to be told from noise, and some under 0.1 m.
  EXPECT_NEAR(error.mean(), 0.0, 4e-4);
  EXPECT_NEAR(error.sigma(), 0.02, 0.02 * 0.02);
  EXPECT_NEAR(static_cast<double>(missing) / total, 0.005, 0.0013);
  EXPECT_NEAR(static_cast<double>(short_echo) / total, 0.005, 0.0014);
}

TEST(Imu, HasTheStatedNoiseAndBias) {
  ImuParams params;
  Moments start_bias;
  Moments walk;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    ImuModel imu(params, seed);
    const double before = imu.gyroBiasZ();
    start_bias.add(before);
    for (int i = 0; i < 100; ++i) (void)imu.measure(at(0.01 * i), 0.0, {0.0, 0.0});
    walk.add(imu.gyroBiasZ() - before);
  }
  // 400 samples: sigma within 18 % at 5 sigma.
  EXPECT_NEAR(start_bias.sigma(), params.gyro_bias_sigma, 0.18 * params.gyro_bias_sigma);
  EXPECT_NEAR(walk.sigma(), params.gyro_bias_walk, 0.18 * params.gyro_bias_walk);

  params.gyro_bias_sigma = params.gyro_bias_walk = 0.0;
  params.accel_bias_sigma = params.accel_bias_walk = 0.0;
  ImuModel imu(params, 1);
  Moments gyro;
  Moments accel;
  Moments down;
  for (int i = 0; i < 10000; ++i) {
    const Imu m = imu.measure(at(0.01 * i), 0.3, {0.5, -0.2});
    gyro.add(m.omega_radps.z());
    accel.add(m.accel_mps2.y());
    down.add(m.accel_mps2.z());
  }
  // At 100 Hz a density of 1e-4 is 1e-3 per sample; 10000 samples: 5 sigma = 5 % / 3.5 %.
  EXPECT_NEAR(gyro.mean(), 0.3, 5e-5);
  EXPECT_NEAR(gyro.sigma(), 1e-3, 3.5e-5);
  EXPECT_NEAR(accel.mean(), -0.2, 1e-3);
  EXPECT_NEAR(accel.sigma(), 0.02, 7e-4);
  EXPECT_NEAR(down.mean(), 9.80665, 1e-3);
}

TEST(Wheels, QuantiseWithoutLosingDistance) {
  WheelParams params;
  params.ticks_per_m = 1000.0;
  WheelModel wheels(params, 0.75);
  Pose2 T_start_now;
  for (int i = 1; i <= 500; ++i) {
    const auto m = wheels.measure(at(0.02 * i), 0.0033 * i, 0.0047 * i);
    EXPECT_DOUBLE_EQ(m.dt_s, 0.02);
    EXPECT_NEAR(std::fmod(m.T_previous_now.phi * 0.75 * 1000.0 + 1e6 + 0.5, 1.0), 0.5, 1e-6);
    T_start_now = compose(T_start_now, m.T_previous_now);
  }
  EXPECT_NEAR(T_start_now.phi, 500 * 0.0014 / 0.75, 2e-3);
  const double radius_m = 0.004 / (0.0014 / 0.75);
  EXPECT_NEAR(T_start_now.x, radius_m * std::sin(500 * 0.0014 / 0.75), 5e-3);
}

TEST(PlaceNoise, IsSmoothAndHasUnitVariance) {
  Moments value;
  Moments product;
  double steepest = 0.0;
  RandomStream random(5, "places");
  for (int i = 0; i < 4000; ++i) {
    const Point2 p{random.uniform(-2000, 2000), random.uniform(-2000, 2000)};
    const double v = placeNoise(11, 0, p, 5.0);
    value.add(v);
    product.add(v * placeNoise(11, 1, p, 5.0));
    steepest = std::max(steepest, std::abs(placeNoise(11, 0, {p.x + 0.01, p.y}, 5.0) - v) / 0.01);
    EXPECT_EQ(placeNoise(11, 0, p, 5.0), v);
  }
  // 4000 samples: 5 sigma = 0.08 for the means, 0.056 for sigma.
  EXPECT_NEAR(value.mean(), 0.0, 0.08);
  EXPECT_NEAR(value.sigma(), 1.0, 0.056);
  EXPECT_NEAR(product.mean(), 0.0, 0.08);
  EXPECT_LT(steepest, 3.0) << "per metre; a jump would be far above";
}

class Gnss : public ::testing::Test {
 protected:
  Gnss() {
    world_.datum = {36.8, -2.4, 20.0};
    world_.buildings.push_back({{"barn", {{0, 0}, {30, 0}, {30, 14}, {0, 14}}}, true});
  }
  [[nodiscard]] Eigen::Vector3d errorOf(const GnssFix& fix, const Point2& p_map) const {
    const geo::TangentPlane plane(world_.datum);
    return plane.toEnu(std::get<Geodetic>(fix.position)) - Eigen::Vector3d(p_map.x, p_map.y, 0.0);
  }
  /// East errors of the first fix, over many receivers, and what they claim.
  void sample(const GnssParams& params, const Point2& p_map, Moments& error, double& claimed_m) {
    for (std::uint64_t seed = 0; seed < 600; ++seed) {
      GnssModel gnss(world_, params, seed);
      const GnssFix fix = gnss.measure(at(0), p_map);
      error.add(errorOf(fix, p_map).x());
      claimed_m = std::sqrt((*fix.cov_enu)(0, 0));
    }
  }
  World world_;
};

// 600 receivers: sigma within 14 % at 5 sigma.

TEST_F(Gnss, IsAsGoodAsItSaysInTheOpen) {
  GnssParams params;
  Moments error;
  double claimed_m = 0.0;
  sample(params, {-60, 0}, error, claimed_m);
  EXPECT_NEAR(error.mean(), 0.0, 0.005);
  EXPECT_NEAR(error.sigma(), 0.0198, 0.14 * 0.0198);
  EXPECT_NEAR(claimed_m, 0.0198, 0.001);

  params.receiver = GnssClass::kSingle;
  Moments single;
  sample(params, {-60, 0}, single, claimed_m);
  EXPECT_NEAR(single.sigma(), std::hypot(1.2, 0.5), 0.14 * 1.3);
  EXPECT_NEAR(claimed_m, single.sigma(), 0.14 * 1.3);
}

TEST_F(Gnss, IsWorseThanItSaysBesideAWall) {
  const GnssParams params;
  Moments error;
  double claimed_m = 0.0;
  const Point2 beside{-0.5, 7.0};
  sample(params, beside, error, claimed_m);
  EXPECT_GT(error.rms(), 2.2);
  EXPECT_GT(error.rms(), 1.25 * claimed_m) << "claims " << claimed_m;
  GnssModel gnss(world_, params, 1);
  EXPECT_EQ(gnss.measure(at(0), beside).type, GnssFixType::kSingle);
}

TEST_F(Gnss, MultipathIsAFunctionOfPlace) {
  GnssParams params;
  params.receiver = GnssClass::kSingle;
  params.single_sigma_m = params.single_white_m = 1e-6;
  GnssModel gnss(world_, params, 4);
  const Eigen::Vector3d first = errorOf(gnss.measure(at(0), {-1, 3}), {-1, 3});
  (void)gnss.measure(at(100), {-1, 11});
  const Eigen::Vector3d again = errorOf(gnss.measure(at(200), {-1, 3}), {-1, 3});
  EXPECT_GT(first.head<2>().norm(), 0.1);
  EXPECT_NEAR((first - again).norm(), 0.0, 1e-4);
}

TEST_F(Gnss, TheSlowErrorKeepsItsCorrelationTime) {
  GnssParams params;
  params.receiver = GnssClass::kSingle;
  params.single_white_m = 1e-6;
  const Point2 open{-60, 0};
  Moments now;
  Moments lagged;
  for (std::uint64_t seed = 0; seed < 600; ++seed) {
    GnssModel gnss(world_, params, seed);
    const double before = errorOf(gnss.measure(at(0), open), open).x();
    GnssFix fix;
    for (int i = 1; i <= 300; ++i) fix = gnss.measure(at(0.2 * i), open);
    now.add(before * before);
    lagged.add(before * errorOf(fix, open).x());
  }
  // 60 s later exp(-1) of the correlation is left; 600 samples: 5 sigma = 0.2.
  EXPECT_NEAR(lagged.mean() / now.mean(), std::exp(-1.0), 0.2);
}

TEST_F(Gnss, IsBlindUnderARoofButForSomeWildFixes) {
  GnssModel gnss(world_, GnssParams{}, 1);
  int none = 0;
  int wild = 0;
  Moments error;
  for (int i = 0; i < 5000; ++i) {
    const Point2 p{5.0 + 0.004 * i, 7.0};
    const GnssFix fix = gnss.measure(at(0.2 * i), p);
    if (fix.type == GnssFixType::kNone) {
      ++none;
      EXPECT_FALSE(fix.cov_enu.has_value());
    } else {
      ++wild;
      EXPECT_EQ(fix.type, GnssFixType::kSingle);
      error.add(errorOf(fix, p).x());
    }
  }
  // 500 episodes of 2 s, 3 % of them wild.
  EXPECT_GT(none, 4700);
  EXPECT_GT(wild, 10);
  EXPECT_GT(error.rms(), 4.0);
}

TEST_F(Gnss, NeedsTimeAfterTheRoof) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    GnssModel gnss(world_, GnssParams{}, seed);
    for (int i = 0; i < 50; ++i) (void)gnss.measure(at(0.2 * i), {15, 7});
    double first_s = -1.0;
    double float_s = -1.0;
    double fixed_s = -1.0;
    for (int i = 0; i < 100; ++i) {
      const GnssFixType type = gnss.measure(at(10.0 + 0.2 * i), {15, -10}).type;
      const double after_s = 0.2 * i;
      if (type != GnssFixType::kNone && first_s < 0) first_s = after_s;
      if (type == GnssFixType::kRtkFloat && float_s < 0) float_s = after_s;
      if (type == GnssFixType::kRtkFixed && fixed_s < 0) fixed_s = after_s;
    }
    EXPECT_GE(first_s, 1.0) << "seed " << seed;
    EXPECT_LE(first_s, 5.2) << "seed " << seed;
    EXPECT_NEAR(float_s - first_s, 2.0, 0.21) << "seed " << seed;
    EXPECT_NEAR(fixed_s - first_s, 6.0, 0.21) << "seed " << seed;
  }
}

}  // namespace
}  // namespace vestibule::sim
