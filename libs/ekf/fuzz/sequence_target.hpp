#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>

#include "vestibule/ekf/filter.hpp"

namespace vestibule::ekf::fuzz {

/// Throws measurements of every kind at a filter: mostly usual ones, some that are anything at all.
/// \tparam Source  below(n) gives one of n numbers, number(mean, sigma) a real one
template <class Source>
class Thrower {
 public:
  explicit Thrower(Source source) : random_(std::move(source)) {}

  [[nodiscard]] const Source& source() const { return random_; }

  void throwAt(MapFilter& filter) {
    // Clocks that jump, messages that overtake each other, and two at once.
    const double step_s = random_.below(40) == 0 ? number(0.0, 5.0) : number(0.05, 0.05);
    if (random_.below(20) != 0) now_ns_ += static_cast<std::int64_t>(step_s * 1e9);
    const Timestamp stamp{now_ns_};
    switch (random_.below(8)) {
      case 0:
      case 1: {
        Imu imu;
        imu.stamp = stamp;
        imu.omega_radps = {value(0.1), value(0.1), value(0.1)};
        imu.accel_mps2 = {value(0.5), value(0.5), 9.81 + value(0.5)};
        (void)filter.process(imu);
        break;
      }
      case 2:
      case 3:
        (void)filter.process(
            WheelOdometry{stamp, value(0.05), Pose2(value(0.1), value(0.01), value(0.02))});
        break;
      case 4: {
        Heading heading{stamp, value(1.0), {}, {}};
        if (random_.below(2) == 0) heading.sigma_rad = value(0.1);
        if (random_.below(2) == 0) heading.tilt = Tilt{value(0.1), value(0.1)};
        (void)filter.process(heading);
        break;
      }
      case 5: {
        MapFix fix;
        fix.stamp = stamp;
        fix.p_map_antenna = {value(3.0), value(3.0), value(3.0)};
        fix.type = static_cast<GnssFixType>(random_.below(6));
        if (random_.below(2) == 0) fix.cov = covariance();
        if (random_.below(2) == 0) fix.hdop = value(1.0);
        if (random_.below(2) == 0) fix.satellites = static_cast<int>(random_.below(12));
        if (random_.below(2) == 0) fix.velocity = velocity();
        (void)filter.process(fix);
        break;
      }
      case 6:
        (void)filter.processExternalPose(stamp, pose());
        break;
      default:
        (void)filter.reset(stamp, pose());
    }
  }

 private:
  double number(double mean, double sigma) { return random_.number(mean, sigma); }
  /// Mostly of the usual size, sometimes anything at all.
  double value(double usual) {
    switch (random_.below(40)) {
      case 0:
        return std::numeric_limits<double>::quiet_NaN();
      case 1:
        return std::numeric_limits<double>::infinity();
      case 2:
        return -std::numeric_limits<double>::infinity();
      case 3:
        return number(0.0, 1e300);
      case 4:
        return number(0.0, 1e6);
      case 5:
        return 0.0;
      case 6:
        return number(0.0, 1e-300);
      case 7:
        return number(0.0, 100.0 * usual);
      default:
        return number(0.0, usual);
    }
  }
  GnssVelocity velocity() {
    GnssVelocity v;
    v.enu_mps = {value(0.7), value(0.7), value(0.1)};
    if (random_.below(2) == 0) v.sigma_mps = value(0.1);
    return v;
  }
  Eigen::Matrix3d covariance() {
    Eigen::Matrix3d C = Eigen::Matrix3d::Zero();
    for (int i = 0; i < 3; ++i) C(i, i) = value(2.0);
    if (random_.below(4) == 0) C(0, 1) = value(1.0);
    return C;
  }
  PoseWithCovariance pose() {
    PoseWithCovariance T{Pose2(value(3.0), value(3.0), value(1.0)), covariance().cwiseAbs()};
    return T;
  }

  Source random_;
  std::int64_t now_ns_ = 0;
};

/// What is wrong with a filter's estimates: not finite, not symmetric, not positive semi-definite.
/// Empty when all is well.
[[nodiscard]] std::string faultOf(const MapFilter& filter);

/// Reads the bytes as a sequence of measurements, feeds them to a filter and looks at it after
/// each. \return what was wrong; empty when all is well
[[nodiscard]] std::string feedSequence(const std::uint8_t* data, std::size_t size);

}  // namespace vestibule::ekf::fuzz
