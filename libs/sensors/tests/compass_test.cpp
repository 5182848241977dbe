#include "vestibule/sensors/compass.hpp"

#include <gtest/gtest.h>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule {
namespace {

TEST(CompassDeviation, IsTakenOutOfTheReading) {
  CompassDeviation deviation;
  deviation.coefficients_deg = {7.0, 4.0, -2.0, 5.0, 1.0};
  deviation.sigma_rad = degToRad(2.0);
  // At a reading of 90 degrees (east): A + B - E = 10. At 180 (south): A - C + E = 10. At 45
  // (north east): 7 + (4 - 2) / sqrt(2) + 5.
  const struct {
    double reading_deg, deviation_deg;
  } cases[] = {{90.0, 10.0}, {180.0, 10.0}, {45.0, 12.0 + std::sqrt(2.0)}, {0.0, 6.0}};
  for (const auto& c : cases) {
    EXPECT_NEAR(radToDeg(deviation.at(degToRad(c.reading_deg))), c.deviation_deg, 1e-9);
    Heading heading;
    heading.yaw_rad = yawFromBearing(degToRad(c.reading_deg));
    const Heading corrected = deviation.corrected(heading);
    EXPECT_NEAR(
        radToDeg(angleDiff(
            corrected.yaw_rad, yawFromBearing(degToRad(c.reading_deg - c.deviation_deg)))),
        0.0,
        1e-9)
        << c.reading_deg;
    EXPECT_DOUBLE_EQ(corrected.offset_sigma_rad.value(), deviation.sigma_rad);
  }
}

TEST(CompassDeviation, LeavesHeadingsAloneWhereNothingIsKnown) {
  Heading heading;
  heading.yaw_rad = 1.25;
  const Heading same = CompassDeviation().corrected(heading);
  EXPECT_EQ(same.yaw_rad, 1.25);
  EXPECT_FALSE(same.offset_sigma_rad.has_value());
}

TEST(CompassDeviation, NeedsAllItsCoefficients) {
  EXPECT_THROW(
      (void)parseParams<CompassDeviation>("deviation_deg: [1, 2, 3]\n", "c.yaml"), ConfigError);
  const auto deviation =
      parseParams<CompassDeviation>("deviation_deg: [1, 2, 3, 4, 5]\nsigma_deg: 2\n", "c.yaml");
  EXPECT_EQ(deviation.coefficients_deg.size(), 5U);
  EXPECT_FALSE(parseParams<CompassDeviation>("deviation_deg: []\n", "c.yaml").known());
}

}  // namespace
}  // namespace vestibule
