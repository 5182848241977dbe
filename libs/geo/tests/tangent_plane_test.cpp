#include "vestibule/geo/tangent_plane.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::geo {
namespace {

TEST(TangentPlane, RoundTripsToMicrometresAtAnyDistance) {
  const TangentPlane plane({42.36, -71.1, 12.0});
  RandomStream rng(3, "enu");
  for (int i = 0; i < 200; ++i) {
    const double reach = std::pow(10.0, rng.uniform(0.0, 5.0));
    const Eigen::Vector3d enu(
        rng.uniform(-reach, reach), rng.uniform(-reach, reach), rng.uniform(-50.0, 50.0));
    EXPECT_LT((plane.toEnu(plane.toGeodetic(enu)) - enu).norm(), 2e-6) << enu.transpose();
  }
}

TEST(TangentPlane, AxesAreEastNorthUpWithTheRadiiOfWgs84) {
  // Meridian and prime-vertical radii of curvature, WGS-84 (NIMA TR8350.2).
  constexpr double kA = 6378137.0;
  constexpr double kE2 = 6.69437999014e-3;
  const double lat = degToRad(36.8);
  const double w = std::sqrt(1.0 - kE2 * std::sin(lat) * std::sin(lat));
  const double meridian = kA * (1.0 - kE2) / (w * w * w);
  const double normal = kA / w;
  const TangentPlane plane({36.8, -2.4, 0.0});
  constexpr double kStepDeg = 1e-5;
  const auto north = plane.toEnu({36.8 + kStepDeg, -2.4, 0.0});
  EXPECT_NEAR(north.y(), meridian * degToRad(kStepDeg), 1e-6);
  EXPECT_NEAR(north.x(), 0.0, 1e-6);
  const auto east = plane.toEnu({36.8, -2.4 + kStepDeg, 0.0});
  EXPECT_NEAR(east.x(), normal * std::cos(lat) * degToRad(kStepDeg), 1e-6);
  EXPECT_NEAR(plane.toEnu({36.8, -2.4, 7.0}).z(), 7.0, 1e-9);
}

TEST(TangentPlane, RefusesADatumThatIsNotOnEarth) {
  EXPECT_THROW(TangentPlane({91.0, 0.0, 0.0}), ConfigError);
  EXPECT_THROW(TangentPlane({0.0, std::nan(""), 0.0}), ConfigError);
}

}  // namespace
}  // namespace vestibule::geo
