#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "vestibule/core/time.hpp"

namespace vestibule::ekf {

/// Do fixes move as the robot does? Reflections and receivers that coast carry fixes away slowly
/// enough for every single one to pass a test against the estimate, which they take along. Here a
/// fix is compared with good ones of the last time: what it moved since each of them, against
/// odometry.
class GnssDrift {
 public:
  struct Fix {
    Timestamp stamp;
    Eigen::Vector2d p_map = Eigen::Vector2d::Zero();   ///< [m] antenna by the receiver
    Eigen::Vector2d p_odom = Eigen::Vector2d::Zero();  ///< [m] antenna by odometry
  };
  struct Noise {
    double sigma_m = 0.0;        ///< of a fix, per axis
    double correlation_s = 0.0;  ///< after that time their errors have little to do with each other
    double yaw_sigma_rad = 0.0;  ///< of yaw_map_odom
  };

  /// \param window_s  good fixes of that time are remembered; 0: none, every fix passes
  explicit GnssDrift(double window_s) : window_s_(window_s) {}

  /// Largest normalized squared difference to a remembered fix, of two degrees of freedom; 0 if
  /// none is remembered. \param yaw_map_odom_rad  turns odometry's axes into those of the map
  [[nodiscard]] double nis(const Fix& fix, double yaw_map_odom_rad, const Noise& noise) const;
  /// Remembers a fix that was good.
  void good(const Fix& fix);
  void forget() { count_ = 0; }

 private:
  static constexpr std::size_t kMost = 16;

  double window_s_;
  std::array<Fix, kMost> fixes_;  ///< a ring; the newest is fixes_[(next_ + kMost - 1) % kMost]
  std::size_t next_ = 0;
  std::size_t count_ = 0;
};

}  // namespace vestibule::ekf
