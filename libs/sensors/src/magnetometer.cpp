#include "vestibule/sensors/magnetometer.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "vestibule/core/angles.hpp"

namespace vestibule {
namespace {

// On the ground the Earth's field has 22 to 67 uT (NOAA/NCEI, World Magnetic Model 2020).
constexpr double kWeakest_tesla = 20e-6;
constexpr double kStrongest_tesla = 70e-6;
constexpr double kStrengthShare = 0.2;
constexpr double kMostDip_rad = degToRad(10.0);
// With the field nearly upright the rest of it tells no direction.
constexpr double kLeastLevelShare = 0.1;
constexpr double kMemory_s = 180.0;
constexpr double kEvery_s = 0.5;
constexpr double kGravity_s = 1.0;
constexpr double kLeastForce_mps2 = 5.0;

}  // namespace

void Magnetometer::take(const Imu& imu) {
  if (!imu.accel_mps2.allFinite() || imu.accel_mps2.norm() < kLeastForce_mps2) return;
  const double dt_s = gravity_stamp_ ? toSeconds(imu.stamp - *gravity_stamp_) : 1e9;
  if (dt_s <= 0.0) return;
  up_mps2_ += -std::expm1(-dt_s / kGravity_s) * (imu.accel_mps2 - up_mps2_);
  gravity_stamp_ = imu.stamp;
}

double Magnetometer::median(double Sample::*what) const {
  std::vector<double> values;
  values.reserve(recent_.size());
  for (const Sample& s : recent_) values.push_back(s.*what);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void Magnetometer::remember(const Sample& sample) {
  if (!recent_.empty() && toSeconds(sample.stamp - recent_.back().stamp) < kEvery_s) return;
  recent_.push_back(sample);
  while (toSeconds(sample.stamp - recent_.front().stamp) > kMemory_s) recent_.pop_front();
}

Magnetometer::Reading Magnetometer::read(Timestamp stamp, const Eigen::Vector3d& field_tesla) {
  if (!gravity_stamp_) return {std::nullopt, "before there is an acceleration to level it by"};
  const double strength = field_tesla.norm();
  if (strength < kWeakest_tesla || strength > kStrongest_tesla) {
    return {std::nullopt, "that are not the Earth's (20 to 70 uT; the unit is Tesla)"};
  }
  const Eigen::Vector3d up = up_mps2_.normalized();
  const double rise = field_tesla.dot(up);
  const Eigen::Vector3d level = field_tesla - rise * up;
  const Sample sample{stamp, strength, std::atan2(-rise, level.norm())};
  remember(sample);
  if (std::abs(strength / median(&Sample::strength_tesla) - 1.0) > kStrengthShare) {
    return {std::nullopt, "of a strength off by more than 20 %: steel or currents nearby"};
  }
  if (std::abs(sample.dip_rad - median(&Sample::dip_rad)) > kMostDip_rad) {
    return {std::nullopt, "of a dip off by more than 10 deg: steel or currents nearby"};
  }
  const Eigen::Vector3d ahead = Eigen::Vector3d::UnitX() - up.x() * up;
  if (level.norm() < kLeastLevelShare * strength || ahead.norm() < kLeastLevelShare) {
    return {std::nullopt, "too steep to tell a direction"};
  }
  const double north = std::atan2(level.dot(up.cross(ahead)), level.dot(ahead));
  Heading heading;
  heading.stamp = stamp;
  heading.yaw_rad = wrapToPi(0.5 * kPi - north);
  return {heading, ""};
}

}  // namespace vestibule
