#include "vestibule/core/frames.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "matchers.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule {
namespace {

Pose2 randomPose(RandomStream& rng) {
  return {rng.uniform(-50, 50), rng.uniform(-50, 50), rng.uniform(-kPi, kPi)};
}

TEST(Angles, WrapKeepsTheDirection) {
  EXPECT_NEAR(wrapToPi(3.0 * kPi + 0.1), -kPi + 0.1, 1e-12);
  EXPECT_NEAR(angleDiff(-kPi + 0.1, kPi - 0.1), 0.2, 1e-12);
  EXPECT_NEAR(wrapToPi(1e6), std::atan2(std::sin(1e6), std::cos(1e6)), 1e-9);
  EXPECT_TRUE(std::isnan(wrapToPi(NAN)));
  EXPECT_NEAR(yawFromBearing(degToRad(90.0)), 0.0, 1e-12);  // east
  EXPECT_NEAR(yawFromBearing(0.0), kPi / 2.0, 1e-12);       // north
}

TEST(Frames, GroupLawsHold) {
  RandomStream rng(1, "group-laws");
  for (int i = 0; i < 200; ++i) {
    const Pose2 a = randomPose(rng);
    const Pose2 b = randomPose(rng);
    const Pose2 c = randomPose(rng);
    EXPECT_THAT(compose(compose(a, b), c), poseNear(compose(a, compose(b, c)), 1e-11, 1e-12));
    EXPECT_THAT(compose(a, inverse(a)), poseNear({0, 0, 0}, 1e-12, 1e-12));
    EXPECT_THAT(compose(a, between(a, b)), poseNear(b, 1e-11, 1e-12));
    const Point2 p = transform(a, transform(b, {1.0, 2.0}));
    const Point2 q = transform(compose(a, b), {1.0, 2.0});
    EXPECT_NEAR(p.x, q.x, 1e-11);
    EXPECT_NEAR(p.y, q.y, 1e-11);
  }
}

TEST(Frames, ExponentialAndLogarithmAreInverse) {
  RandomStream rng(2, "exp-log");
  for (int i = 0; i < 200; ++i) {
    const double scale = std::pow(10.0, rng.uniform(-9, 0.4));
    const Eigen::Vector3d xi(rng.normal(), rng.normal(), scale * rng.uniform(-1, 1));
    EXPECT_LT((logSe2(expSe2(xi)) - xi).norm(), 1e-10) << xi.transpose();
  }
  // A quarter circle of radius 1.
  EXPECT_THAT(expSe2({kPi / 2, 0, kPi / 2}), poseNear({1, 1, kPi / 2}, 1e-12, 1e-12));
}

TEST(Frames, InterpolationIsHalfWayAndExactAtTheEnds) {
  const Pose2 a{1, 2, 3.0};
  const Pose2 b{2, 3, -3.0};
  EXPECT_THAT(interpolate(a, b, 0.0), poseNear(a, 1e-12, 1e-12));
  EXPECT_THAT(interpolate(a, b, 1.0), poseNear(b, 1e-12, 1e-12));
  const Pose2 half = interpolate(a, b, 0.5);
  EXPECT_THAT(compose(half, between(a, half)), poseNear(b, 1e-12, 1e-12));
}

TEST(Frames, CovarianceIsCarriedByTheJacobianOfComposition) {
  // GIVEN a pose that is uncertain in yaw only, and a point 10 m ahead
  PoseWithCovariance T_a_b{{1, 2, kPi / 2}, Eigen::Matrix3d::Zero()};
  T_a_b.cov(2, 2) = 0.01 * 0.01;
  // WHEN composed, THEN the far end moves sideways by 10 m * sigma_yaw
  const auto T_a_c = compose(T_a_b, Pose2{10, 0, 0});
  EXPECT_NEAR(std::sqrt(T_a_c.cov(0, 0)), 0.1, 1e-12);
  EXPECT_NEAR(T_a_c.cov(1, 1), 0.0, 1e-12);
  // AND an exact transform only turns the axes
  const auto turned = compose(Pose2{0, 0, kPi / 2}, PoseWithCovariance{{0, 0, 0}, T_a_c.cov});
  EXPECT_NEAR(std::sqrt(turned.cov(1, 1)), 0.1, 1e-12);
}

}  // namespace
}  // namespace vestibule
