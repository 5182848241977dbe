#pragma once

#include <deque>
#include <optional>
#include <string>

#include "vestibule/sensors/measurements.hpp"

namespace vestibule {

/// Heading out of the magnetic field, levelled by gravity, as long as the field may be the Earth's:
/// steel nearby changes its strength and its dip, too (Groves, Principles of GNSS, Inertial, and
/// Multisensor Integrated Navigation Systems, 2nd ed. 2013, sec. 6.1.1). Both are compared with
/// what they mostly were in the last minutes, since the Earth's own differ from place to place.
class Magnetometer {
 public:
  struct Reading {
    std::optional<Heading> heading;  ///< ENU, declination and mounting still in it
    std::string refused;             ///< why there is none
  };

  /// Gravity for the readings that follow, averaged over about a second.
  void take(const Imu& imu);
  /// `field_tesla` in base axes. Precondition: finite.
  [[nodiscard]] Reading read(Timestamp stamp, const Eigen::Vector3d& field_tesla);

 private:
  struct Sample {
    Timestamp stamp;
    double strength_tesla = 0.0;
    double dip_rad = 0.0;
  };
  /// Of what is remembered.
  [[nodiscard]] double median(double Sample::*what) const;
  void remember(const Sample& sample);

  std::optional<Timestamp> gravity_stamp_;
  Eigen::Vector3d up_mps2_ = Eigen::Vector3d::Zero();  ///< specific force, base axes, smoothed
  std::deque<Sample> recent_;
};

}  // namespace vestibule
