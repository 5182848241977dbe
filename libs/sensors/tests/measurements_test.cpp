#include "vestibule/sensors/measurements.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "vestibule/core/angles.hpp"

namespace vestibule {
namespace {

TEST(LaserScan, OnlyEchoesBecomeEndPointsAndTheMountingIsApplied) {
  LaserScan scan;
  scan.angle_min_rad = -kPi / 2.0;
  scan.angle_step_rad = kPi / 2.0;
  scan.range_min_m = 0.1;
  scan.range_max_m = 10.0;
  scan.ranges_m = {2.0F, 0.05F, 3.0F, 10.0F, std::numeric_limits<float>::quiet_NaN()};
  scan.T_base_laser = {1.0, 0.0, kPi / 2.0};
  const auto points = endPointsInBase(scan);
  ASSERT_EQ(points.size(), 2U);
  // -90 deg in a laser turned by +90 deg is straight ahead.
  EXPECT_NEAR(points[0].x, 3.0, 1e-6);
  EXPECT_NEAR(points[0].y, 0.0, 1e-6);
  EXPECT_NEAR(points[1].x, -2.0, 1e-6);
  EXPECT_NEAR(points[1].y, 0.0, 1e-6);
}

TEST(Measurement, TheStampIsThatOfTheAlternative) {
  GnssFix fix;
  fix.stamp = {42};
  EXPECT_EQ(stampOf(Measurement{fix}).ns, 42);
}

}  // namespace
}  // namespace vestibule
