#pragma once

#include <vector>

#include "relocate.hpp"
#include "submaps.hpp"
#include "vestibule/mapping/finish.hpp"

namespace vestibule::mapping {

/// Finds places seen again and fits the pose graph to them.
class LoopCloser {
 public:
  /// \param keys and \param chain (keys k and k + 1) outlive the closer
  LoopCloser(
      const std::vector<KeyScan>& keys,
      const std::vector<PoseConstraint>& chain,
      const FinishParams& params);

  /// Searches, votes and optimises until nothing new is found. \return poses of the key scans
  [[nodiscard]] std::vector<Pose2> run(std::vector<Pose2> T_map_key, const ShareDone& progress);

  /// All closures of the last round; from and to are key scans.
  [[nodiscard]] const std::vector<Closure>& closures() const { return closures_; }
  /// Chain and accepted closures.
  [[nodiscard]] std::vector<PoseConstraint> graph() const;
  [[nodiscard]] std::size_t submapCount() const { return submaps_.size(); }

 private:
  struct Candidate {
    std::size_t target = 0;        // submap
    std::size_t query = 0;         // submap, later in the drive
    PoseWithCovariance predicted;  // T_target_query by the way through the graph
  };
  struct Found {
    Closure closure;
    PoseConstraint constraint;
    std::size_t target = 0;
    std::size_t query = 0;
  };
  [[nodiscard]] std::vector<PoseWithCovariance> ways(
      std::size_t from_key, const std::vector<std::vector<std::size_t>>& edges_of_key) const;
  [[nodiscard]] std::vector<Candidate> candidates(const std::vector<Pose2>& T_map_key) const;
  /// What was found for each of the candidates. \param open  by target
  [[nodiscard]] std::vector<std::vector<Found>> compareAll(
      const std::vector<Candidate>& open,
      const std::vector<Pose2>& T_map_key,
      const ShareDone& progress) const;
  /// \param a       cluster of the candidate's target
  /// \param places  on it
  [[nodiscard]] std::vector<Found> compare(
      const Candidate& candidate,
      const Cluster& a,
      PlaceFinder& places,
      const std::vector<Pose2>& T_map_key) const;
  void vote(std::vector<Found>& found, const std::vector<Pose2>& T_map_key) const;

  const std::vector<KeyScan>& keys_;
  const std::vector<PoseConstraint>& chain_;
  FinishParams params_;
  double gate_chi2_;
  std::vector<Submap> submaps_;
  std::vector<Found> accepted_;
  std::vector<Closure> closures_;
};

}  // namespace vestibule::mapping
