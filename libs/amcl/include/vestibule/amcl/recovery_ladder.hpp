#pragma once

#include <optional>

#include "vestibule/amcl/particle_localizer.hpp"

namespace vestibule::amcl {

/// Searches again when the scans have not fitted the map for a while: around where the last fitting
/// pose and the odometry since put the robot, wider at each try, and in the end in the whole map.
/// For a robot that has nothing but the map; with GNSS the mode manager seeds the particles.
class RecoveryLadder {
 public:
  /// \param localizer initialised; outlives the ladder
  /// \param T_map_base_start where it was initialised; empty after a global start
  /// \param observers may be null; receives a WarningEvent per try
  RecoveryLadder(
      const AmclParams& params,
      ParticleLocalizer& localizer,
      const std::optional<Pose2>& T_map_base_start,
      const Observers* observers = nullptr);

  void process(const WheelOdometry& odometry);
  /// Call after every scan with the localizer's report.
  void process(const LaserScan& scan, const ScanReport& report);

  [[nodiscard]] int tries() const { return tries_; }

 private:
  RecoveryParams params_;
  ParticleLocalizer& localizer_;
  const Observers* observers_;
  std::optional<Pose2> T_map_base_;  ///< last fitting pose carried on by odometry
  int misfits_ = 0;                  ///< used scans in a row that did not fit
  int stage_ = 0;
  int tries_ = 0;
};

}  // namespace vestibule::amcl
