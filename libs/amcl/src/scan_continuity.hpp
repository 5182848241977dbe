#pragma once

#include <optional>

#include "vestibule/core/frames.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::amcl {

/// Whether scans go on from one to the next as the odometry says. Who is carried away with the
/// eyes open sees the surroundings change at once, however well they fit the map elsewhere.
class ScanContinuity {
 public:
  /// \param T_odom_base at the scan
  /// \return true when two scans in a row have next to nothing of what was seen just before
  [[nodiscard]] bool breaks(const LaserScan& scan, const Pose2& T_odom_base);
  /// Nothing that was seen so far counts.
  void restart();

  /// Share of the scan's ends that an earlier scan saw as far away; empty when too few of them lie
  /// in its view.
  [[nodiscard]] static std::optional<double> agreement(
      const LaserScan& earlier, const LaserScan& later, const Pose2& T_earlier_later);

 private:
  struct Seen {
    LaserScan scan;
    Pose2 T_odom_base;
  };
  std::optional<Seen> before_;
  int broken_ = 0;
};

}  // namespace vestibule::amcl
