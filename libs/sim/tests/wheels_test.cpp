#include "vestibule/sim/wheels.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "moments.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/sim/compass.hpp"
#include "vestibule/sim/place_noise.hpp"

namespace vestibule::sim {
namespace {

TEST(Wheels, QuantiseWithoutLosingDistance) {
  WheelParams params;
  params.ticks_per_m = 1000.0;
  WheelModel wheels(params, RobotParams{});
  Pose2 T_start_now;
  for (int i = 1; i <= 500; ++i) {
    const auto m = wheels.measure({}, 0.0033 * i, 0.0047 * i);
    EXPECT_DOUBLE_EQ(m.dt_s, 0.02);
    EXPECT_NEAR(std::fmod(m.T_previous_now.phi * 0.75 * 1000.0 + 1e6 + 0.5, 1.0), 0.5, 1e-6);
    T_start_now = compose(T_start_now, m.T_previous_now);
  }
  EXPECT_NEAR(T_start_now.phi, 500 * 0.0014 / 0.75, 2e-3);
  const double radius_m = 0.004 / (0.0014 / 0.75);
  EXPECT_NEAR(T_start_now.x, radius_m * std::sin(500 * 0.0014 / 0.75), 5e-3);
}

TEST(Wheels, BelieveTheirRadii) {
  WheelParams params;
  params.scale_left = params.scale_right = 1.05;
  WheelModel wheels(params, RobotParams{});
  EXPECT_NEAR(wheels.measure({}, 1.0, 1.0).T_previous_now.x, 1.05, 1e-9);
}

TEST(Compass, IsRightOutsideAndBentInside) {
  CompassParams params;
  params.deviation_rad = 0.0;
  CompassModel compass(params, 3);
  Moments open;
  Moments inside;
  RandomStream random(1, "places");
  for (int i = 0; i < 2000; ++i) {
    const Pose2 T{random.uniform(0, 500), random.uniform(0, 500), random.uniform(-kPi, kPi)};
    const Heading out = compass.measure({}, T, 50.0);
    const Heading in = compass.measure({}, T, -2.0);
    EXPECT_EQ(out.sigma_rad, in.sigma_rad) << "it does not know";
    open.add(angleDiff(out.yaw_rad, T.phi));
    inside.add(angleDiff(in.yaw_rad, T.phi));
  }
  // 2000 samples: 5 sigma of sigma = 8 %.
  EXPECT_NEAR(open.rms(), params.sigma_rad, 0.08 * params.sigma_rad);
  EXPECT_NEAR(inside.rms(), params.indoor_rad, 0.08 * params.indoor_rad);
}

TEST(Compass, HasIronOfItsOwnAndCrossesThatOfTheGround) {
  CompassParams params;
  params.sigma_rad = 1e-6;
  params.deviation_rad = 0.04;
  params.soft_iron_rad = 0.03;
  CompassModel own(params, 3);
  // One turn on the spot: what comes once and twice per turn, nothing else.
  constexpr int kSteps = 360;
  std::complex<double> once;
  std::complex<double> twice;
  Moments rest;
  for (int i = 0; i < kSteps; ++i) {
    const double yaw_rad = wrapToPi(2.0 * kPi * i / kSteps);
    const double error_rad = angleDiff(own.measure({}, {5, 5, yaw_rad}, 50.0).yaw_rad, yaw_rad);
    once += 2.0 / kSteps * error_rad * std::polar(1.0, yaw_rad);
    twice += 2.0 / kSteps * error_rad * std::polar(1.0, 2.0 * yaw_rad);
    rest.add(error_rad);
  }
  EXPECT_NEAR(std::abs(once), 0.04, 1e-5);
  EXPECT_NEAR(std::abs(twice), 0.03, 1e-5);
  EXPECT_NEAR(rest.rms(), std::hypot(0.04, 0.03) / std::sqrt(2.0), 1e-5);

  params.deviation_rad = params.soft_iron_rad = 0.0;
  params.ground_rad = 0.1;
  params.ground_length_m = 15.0;
  CompassModel ground(params, 3);
  Moments anywhere;
  Moments near;  // what a metre changes
  RandomStream random(1, "places");
  for (int i = 0; i < 2000; ++i) {
    const Pose2 T{random.uniform(0, 2000), random.uniform(0, 2000), random.uniform(-kPi, kPi)};
    const double here_rad = angleDiff(ground.measure({}, T, 50.0).yaw_rad, T.phi);
    anywhere.add(here_rad);
    near.add(here_rad - angleDiff(ground.measure({}, {T.x + 1, T.y, T.phi}, 50.0).yaw_rad, T.phi));
  }
  EXPECT_NEAR(anywhere.rms(), 0.1, 0.008);
  EXPECT_LT(near.rms(), 0.02);
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

}  // namespace
}  // namespace vestibule::sim
