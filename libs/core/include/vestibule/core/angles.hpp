#pragma once

#include <cmath>

namespace vestibule {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kRadPerDeg = kPi / 180.0;

[[nodiscard]] constexpr double degToRad(double deg) { return deg * kRadPerDeg; }
[[nodiscard]] constexpr double radToDeg(double rad) { return rad / kRadPerDeg; }

/// The same direction in [-pi, pi]. NaN and infinity give NaN.
[[nodiscard]] inline double wrapToPi(double angle_rad) {
  return std::remainder(angle_rad, 2.0 * kPi);
}

/// The shortest turn from b to a, in [-pi, pi]: wrapToPi(a - b).
[[nodiscard]] inline double angleDiff(double a_rad, double b_rad) {
  return wrapToPi(a_rad - b_rad);
}

/// Yaw (counter-clockwise from east) of a compass bearing (clockwise from north), both radians.
[[nodiscard]] inline double yawFromBearing(double bearing_rad) {
  return wrapToPi(kPi / 2.0 - bearing_rad);
}

}  // namespace vestibule
