#include "vestibule/sensors/magnetometer.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule {
namespace {

constexpr double kGravity = 9.81;

Timestamp at(double t_s) { return {static_cast<std::int64_t>(t_s * 1e9)}; }

Eigen::Quaterniond attitude(double yaw_deg, double pitch_deg = 0.0, double roll_deg = 0.0) {
  return Eigen::AngleAxisd(degToRad(yaw_deg), Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(degToRad(pitch_deg), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(degToRad(roll_deg), Eigen::Vector3d::UnitX());
}

/// The Earth's field in ENU: 48 uT, dipping 65 deg.
Eigen::Vector3d earth() {
  return 48e-6 * Eigen::Vector3d(0.0, std::cos(degToRad(65.0)), -std::sin(degToRad(65.0)));
}

Magnetometer::Reading readAt(
    Magnetometer& m, double t_s, const Eigen::Quaterniond& q, const Eigen::Vector3d& field_enu) {
  for (int i = 0; i < 20; ++i) {
    Imu imu;
    imu.stamp = at(t_s + 0.01 * i);
    imu.accel_mps2 = q.conjugate() * Eigen::Vector3d(0.0, 0.0, kGravity);
    m.take(imu);
  }
  return m.read(at(t_s + 0.2), q.conjugate() * field_enu);
}

TEST(Magnetometer, GivesTheHeadingOfATiltedRobot) {
  for (const double yaw_deg : {-170.0, -90.0, 0.0, 35.0, 120.0}) {
    Magnetometer m;
    const auto reading = readAt(m, 0.0, attitude(yaw_deg, 12.0, -8.0), earth());
    ASSERT_TRUE(reading.heading) << reading.refused;
    // A nose that points down is still ahead: yaw of the forward axis laid level.
    EXPECT_NEAR(radToDeg(angleDiff(reading.heading->yaw_rad, degToRad(yaw_deg))), 0.0, 1e-9);
  }
}

TEST(Magnetometer, RefusesSteelByStrengthAndByDipAndTakesTheFieldAgainAfterwards) {
  Magnetometer m;
  double t_s = 0.0;
  for (; t_s < 20.0; t_s += 1.0) ASSERT_TRUE(readAt(m, t_s, attitude(3.0 * t_s), earth()).heading);
  const auto stronger = readAt(m, t_s++, attitude(40.0), 1.3 * earth());
  EXPECT_FALSE(stronger.heading);
  EXPECT_NE(stronger.refused.find("strength"), std::string::npos);
  const Eigen::AngleAxisd bent(degToRad(15.0), Eigen::Vector3d::UnitX());
  const auto steeper = readAt(m, t_s++, attitude(40.0), bent * earth());
  EXPECT_FALSE(steeper.heading);
  EXPECT_NE(steeper.refused.find("dip"), std::string::npos);
  EXPECT_TRUE(readAt(m, t_s++, attitude(40.0), earth()).heading);
}

TEST(Magnetometer, LearnsTheFieldOfAnotherPlace) {
  Magnetometer m;
  double t_s = 0.0;
  for (; t_s < 30.0; t_s += 1.0) (void)readAt(m, t_s, attitude(0.0), 1.4 * earth());
  for (; t_s < 260.0; t_s += 1.0) (void)readAt(m, t_s, attitude(0.0), earth());
  EXPECT_TRUE(readAt(m, t_s, attitude(0.0), earth()).heading);
  EXPECT_FALSE(readAt(m, t_s + 1.0, attitude(0.0), 1.4 * earth()).heading);
}

TEST(Magnetometer, NeedsGravityAndTesla) {
  Magnetometer m;
  EXPECT_NE(m.read(at(0.0), earth()).refused.find("acceleration"), std::string::npos);
  const auto gauss = readAt(m, 0.0, attitude(0.0), 1e4 * earth());
  EXPECT_FALSE(gauss.heading);
  EXPECT_NE(gauss.refused.find("Tesla"), std::string::npos);
  const auto upright = readAt(m, 1.0, attitude(0.0), Eigen::Vector3d(1e-6, 0.0, -48e-6));
  EXPECT_NE(upright.refused.find("steep"), std::string::npos);
}

}  // namespace
}  // namespace vestibule
