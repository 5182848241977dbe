#pragma once

#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"

namespace vestibule::test {

/// A robot with a laser at its centre drives a loop in a closed room of 9 x 7 m with a niche and a
/// pillar, so that no two places look alike. 181 beams over 180 degrees, one scan per 0.1 m.
struct RoomDrive {
  std::vector<Pose2> poses;       ///< true T_map_base, one per scan
  std::vector<Timestamp> stamps;  ///< two of them run backwards

  RoomDrive();
  /// The drive as a CARMEN log.
  /// \param corrected true: the lines carry the true poses; false: odometry that starts at zero and
  ///                  over-counts distance by 2 %
  [[nodiscard]] std::string carmenLog(bool corrected) const;
};

}  // namespace vestibule::test
