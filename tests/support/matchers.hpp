#pragma once

#include <gmock/gmock.h>
#include <mrpt/math/TPose2D.h>

#include <cmath>

namespace vestibule {

/// Matches a pose within tolerances and prints both the pose and the error when it fails.
MATCHER_P3(
    poseNear,
    expected,
    tol_m,
    tol_rad,
    "is within " + ::testing::PrintToString(tol_m) + " m and " + ::testing::PrintToString(tol_rad) +
        " rad of (" + ::testing::PrintToString(expected.x) + ", " +
        ::testing::PrintToString(expected.y) + ", " + ::testing::PrintToString(expected.phi) +
        ")") {
  const double d = std::hypot(arg.x - expected.x, arg.y - expected.y);
  const double a = std::abs(std::remainder(arg.phi - expected.phi, 2.0 * M_PI));
  *result_listener << "pose (" << arg.x << ", " << arg.y << ", " << arg.phi << "), off by " << d
                   << " m and " << a << " rad";
  return d <= tol_m && a <= tol_rad;
}
inline auto poseNear(const mrpt::math::TPose2D& expected, double tol_m, double tol_rad) {
  return poseNear<mrpt::math::TPose2D, double, double>(expected, tol_m, tol_rad);
}

}  // namespace vestibule
