#pragma once

#include <vector>

#include "key_scans.hpp"
#include "vestibule/mapping/finish.hpp"

namespace vestibule::mapping {

/// Refines all key scans together: every pair of scans that shares surfaces pulls with the
/// distances between its points and those surfaces, and all pairs are solved at once.
class JointRefiner {
 public:
  JointRefiner(
      const std::vector<ScanNode>& nodes,
      const std::vector<KeyScan>& keys,
      const RefineParams& params,
      std::size_t threads);

  [[nodiscard]] std::vector<Pose2> run(std::vector<Pose2> T_map_key, const ShareDone& progress);

  /// Poses of all nodes: with the key scans at these, each other one is placed on those around it.
  /// Without iterations in run() the odometry alone places them.
  [[nodiscard]] std::vector<Pose2> placeAll(const std::vector<Pose2>& T_map_key) const;

  [[nodiscard]] std::size_t pairCount() const { return pairs_.size(); }
  [[nodiscard]] double rmsBefore() const { return rms_before_m_; }
  [[nodiscard]] double rmsAfter() const { return rms_after_m_; }

 private:
  struct Pair {
    std::size_t from = 0;
    std::size_t to = 0;
  };
  /// \param k  last key scan before the scan
  [[nodiscard]] Pose2 place(
      const LaserScan& scan,
      const Pose2& T_map_guess,
      std::size_t k,
      const std::vector<Pose2>& T_map_key) const;
  void choosePairs(const std::vector<Pose2>& T_map_key);
  [[nodiscard]] std::vector<PairQuadratic> linearise(
      const std::vector<Pose2>& T_map_key, double gate_m, double& rms_m) const;

  const std::vector<ScanNode>& nodes_;
  const std::vector<KeyScan>& keys_;
  RefineParams params_;
  std::size_t threads_;
  std::vector<Pair> pairs_;
  std::vector<std::vector<std::size_t>> neighbours_;  // per key scan: those it is compared with
  double rms_before_m_ = 0.0;
  double rms_after_m_ = 0.0;
};

}  // namespace vestibule::mapping
