#include "vestibule/metrics/statistics.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "vestibule/core/angles.hpp"

namespace vestibule::metrics {
namespace {

TEST(Statistics, AreThoseOfAKnownList) {
  const Statistics s = statistics({4.0, 1.0, 3.0, 2.0});
  EXPECT_EQ(s.count, 4u);
  EXPECT_DOUBLE_EQ(s.mean, 2.5);
  EXPECT_DOUBLE_EQ(s.median, 2.5);
  EXPECT_DOUBLE_EQ(s.max, 4.0);
  EXPECT_DOUBLE_EQ(s.rmse, std::sqrt(7.5));
  EXPECT_DOUBLE_EQ(s.stddev, std::sqrt(1.25));
  EXPECT_NEAR(s.p95, 3.85, 1e-12);
}

TEST(Statistics, OfNothingAreZero) {
  EXPECT_EQ(statistics({}).count, 0u);
  EXPECT_EQ(statistics({}).max, 0.0);
}

TEST(ChiSquare, QuantilesAreThoseOfTheTables) {
  EXPECT_NEAR(chiSquareQuantile(0.95, 1), 3.8415, 1e-4);
  EXPECT_NEAR(chiSquareQuantile(0.999, 1), 10.8276, 1e-4);
  EXPECT_NEAR(chiSquareQuantile(0.999, 2), 13.8155, 1e-4);
  EXPECT_NEAR(chiSquareQuantile(0.999, 3), 16.2662, 1e-4);
  EXPECT_NEAR(chiSquareQuantile(0.025, 3), 0.2158, 1e-4);
  EXPECT_NEAR(chiSquareQuantile(0.975, 150), 185.8004, 1e-3);
}

TEST(Nees, WrapsYawAndWeighsByTheCovariance) {
  PoseWithCovariance estimate;
  estimate.mean = Pose2(1.0, 2.0, kPi - 0.05);
  estimate.cov.diagonal() << 0.04, 0.01, 0.01;
  const auto value = nees(estimate, Pose2(0.8, 2.1, -kPi + 0.05));
  ASSERT_TRUE(value);
  EXPECT_NEAR(*value, 1.0 + 1.0 + 1.0, 1e-9);
}

TEST(Nees, RefusesACovarianceThatIsNone) {
  PoseWithCovariance estimate;
  EXPECT_FALSE(nees(estimate, Pose2()));
  estimate.cov.setIdentity();
  EXPECT_FALSE(nees(estimate, Pose2(std::numeric_limits<double>::quiet_NaN(), 0, 0)));
}

}  // namespace
}  // namespace vestibule::metrics
