#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>

#include "vestibule/core/frames.hpp"

namespace vestibule::ekf {

/// Blocks of the error vector. True = estimate (+) error; the attitude error turns in map axes:
/// R_true = Exp(error) * R. Everything else is additive.
enum ErrorIndex : int {
  kPos = 0,             ///< [m] base position in map (or odom), 3
  kVel = 3,             ///< [m/s] base velocity, map axes, 3
  kAtt = 6,             ///< [rad] attitude, map axes, 3; the last is yaw
  kGyroBias = 9,        ///< [rad/s] base axes, 3
  kAccelBias = 12,      ///< [m/s^2] base axes, 3
  kWheelScale = 15,     ///< [-] log of (true distance / wheel distance)
  kWheelSkew = 16,      ///< [rad/m] turn per distance of wheels that claim to go straight
  kTrack = 17,          ///< [-] log of (turn claimed by the wheels / true turn)
  kIcrX = 18,           ///< [m] centre of rotation ahead of the base: v_y = -omega * icr_x
  kGnssBias = 19,       ///< [m] slow part of the GNSS error, map axes, 3
  kHeadingOffset = 22,  ///< [rad] heading sensor reading minus yaw: mounting, declination
  kDisturbance = 23,    ///< [rad] the part of that difference that comes and goes (magnetic)
  kStateSize = 24
};
/// A set of them, one bit each.
constexpr std::uint32_t bits(int first, int count) {
  return ((1U << static_cast<unsigned>(count)) - 1U) << static_cast<unsigned>(first);
}
/// Errors that do not exist in the plane.
inline constexpr std::uint32_t kSpatial = bits(kPos + 2, 1) | bits(kVel + 2, 1) | bits(kAtt, 2) |
                                          bits(kGyroBias, 2) | bits(kAccelBias, 3) |
                                          bits(kGnssBias + 2, 1);
using Error = Eigen::Matrix<double, kStateSize, 1>;
using StateMatrix = Eigen::Matrix<double, kStateSize, kStateSize>;

/// What the filter believes.
struct State {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();  ///< R_map_base
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();
  double wheel_scale = 0.0;
  double wheel_skew = 0.0;
  double track = 0.0;
  double icr_x = 0.0;
  Eigen::Vector3d gnss_bias = Eigen::Vector3d::Zero();
  double heading_offset = 0.0;
  double disturbance = 0.0;

  [[nodiscard]] double yaw() const;
  [[nodiscard]] Pose2 pose2() const { return {p.x(), p.y(), yaw()}; }
  [[nodiscard]] Pose3 pose3() const;
  [[nodiscard]] bool allFinite() const;
};

/// x (+) error.
[[nodiscard]] State plus(const State& x, const Error& error);
/// The error that takes `from` to `to`: plus(from, minus(to, from)) == to.
[[nodiscard]] Error minus(const State& to, const State& from);

/// Rotation by the vector's length about its direction.
[[nodiscard]] Eigen::Quaterniond rotationExp(const Eigen::Vector3d& turn_rad);
/// a x b = skew(a) b.
[[nodiscard]] Eigen::Matrix3d skew(const Eigen::Vector3d& a);
/// Attitude of a yaw, a pitch (nose down positive) and a roll, in this order.
[[nodiscard]] Eigen::Quaterniond attitudeOf(double yaw_rad, double pitch_rad, double roll_rad);

}  // namespace vestibule::ekf
