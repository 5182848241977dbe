#include "rest_noise.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "vestibule/core/random.hpp"

namespace vestibule::ekf {
namespace {

constexpr double kDriving = 0.002;  // rad/sqrt(s), as the next two
constexpr double kLeast = 1e-6;
constexpr double kTrue = 0.0005;
constexpr double kBias_radps = 0.02;

/// What is said after so long at rest of a gyro whose readings are means of two raw ones, so that
/// successive ones err alike; root of the mean square of 40 such stops.
double noiseAfter(double time_s, double rate_hz, int axes) {
  double sum = 0.0;
  constexpr int kStops = 40;
  for (unsigned stop = 0; stop < kStops; ++stop) {
    RandomStream random(7, "rest", stop);
    RestNoise noise(axes);
    const double dt_s = 1.0 / rate_hz;
    double said = kDriving;
    Eigen::Vector3d raw = Eigen::Vector3d::Zero();
    for (int k = 0; k < time_s * rate_hz; ++k) {
      const Eigen::Vector3d before = raw;
      for (int i = 3 - axes; i < 3; ++i) {
        raw[i] = kBias_radps + random.normal(0.0, kTrue / std::sqrt(dt_s));
      }
      if (k == 0) continue;
      said = noise.note(0.5 * (before + raw), dt_s, kDriving, kLeast);
    }
    sum += said * said / kStops;
  }
  return std::sqrt(sum);
}

TEST(RestNoise, FindsTheNoiseOfAGyroThatFilters) {
  for (const int axes : {1, 3}) {
    for (const double rate_hz : {30.0, 100.0, 400.0}) {
      EXPECT_NEAR(noiseAfter(60.0, rate_hz, axes), kTrue, 0.1 * kTrue) << rate_hz << " Hz";
    }
  }
}

TEST(RestNoise, IsCarefulAtFirst) {
  EXPECT_DOUBLE_EQ(noiseAfter(0.15, 100.0, 1), kDriving);
  const double soon = noiseAfter(1.0, 100.0, 1);
  EXPECT_GT(soon, 1.5 * kTrue);
  EXPECT_LT(soon, 0.6 * kDriving);
}

TEST(RestNoise, NeverLeavesItsLimits) {
  RestNoise noise(1);
  for (int k = 0; k < 1000; ++k) {
    const Eigen::Vector3d quiet(0.0, 0.0, 0.01);
    EXPECT_GE(noise.note(quiet, 0.01, kDriving, 0.0007), 0.0007);
  }
  noise.restart();
  for (int k = 0; k < 1000; ++k) {
    const Eigen::Vector3d shaken(0.0, 0.0, k / 20 % 2 == 0 ? 0.1 : -0.1);
    EXPECT_LE(noise.note(shaken, 0.01, kDriving, 0.0007), kDriving);
  }
}

}  // namespace
}  // namespace vestibule::ekf
