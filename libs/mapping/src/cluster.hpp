#pragma once

#include <vector>

#include "contour.hpp"
#include "vestibule/core/frames.hpp"

namespace vestibule::mapping {

/// Some scans in a fixed arrangement: part of a submap, or a single scan.
struct Cluster {
  struct Member {
    const Contour* contour = nullptr;
    Pose2 T_cluster_base;
  };
  std::vector<Member> members;
};

/// How the points of two clusters lie on each other. A point is matched when one scan of the other
/// cluster confirms it, and conflicting when none does and one saw through it.
[[nodiscard]] Overlap overlap(
    const Cluster& a, const Cluster& b, const Pose2& T_a_b, double gate_m);

/// What is known of a relative pose beforehand.
struct RelativePrior {
  Pose2 T_a_b;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< x, y, yaw in the axes of a
};

struct Alignment {
  Pose2 T_a_b;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< of the scans alone
  double rms_m = 0.0;                                     ///< of the points across the surfaces
  int pairs = 0;
};

/// Gauss-Newton on the distances between the surfaces of two clusters, from `start`.
[[nodiscard]] Alignment align(
    const Cluster& a,
    const Cluster& b,
    const Pose2& start,
    const AlignmentParams& params,
    const RelativePrior& prior = {});

}  // namespace vestibule::mapping
