#pragma once

#include <cmath>

namespace vestibule::ekf {

/// What makes a quaternion of a rotation vector: (cosine, share * vector).
struct HalfTurn {
  double cosine = 1.0;
  double share = 0.5;  ///< sin(angle / 2) / angle
};

/// \param angle_sq  square of the vector's length
inline HalfTurn halfTurn(double angle_sq) {
  constexpr double kSmall_sq = 0.05 * 0.05;
  if (angle_sq < kSmall_sq) {
    // Series, exact to the last bit; also where the quotient is 0/0.
    const double h_sq = 0.25 * angle_sq;
    return {
        1.0 - h_sq / 2.0 * (1.0 - h_sq / 12.0 * (1.0 - h_sq / 30.0)),
        0.5 * (1.0 - h_sq / 6.0 * (1.0 - h_sq / 20.0 * (1.0 - h_sq / 42.0)))};
  }
  const double angle = std::sqrt(angle_sq);
  return {std::cos(0.5 * angle), std::sin(0.5 * angle) / angle};
}

/// A rotation about the vertical: the two entries of its quaternion that are not zero.
struct LevelTurn {
  double w = 1.0;
  double z = 0.0;
};

inline LevelTurn levelTurn(double turn_rad) {
  const HalfTurn half = halfTurn(turn_rad * turn_rad);
  return {half.cosine, half.share * turn_rad};
}

/// One after the other, in either order.
inline LevelTurn operator*(const LevelTurn& a, const LevelTurn& b) {
  return {a.w * b.w - a.z * b.z, a.w * b.z + a.z * b.w};
}

inline LevelTurn normalized(const LevelTurn& a) {
  const double length = std::sqrt(a.z * a.z + a.w * a.w);
  return {a.w / length, a.z / length};
}

}  // namespace vestibule::ekf
