#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"

namespace vestibule::mapping {

/// A measured relative pose between two nodes of a graph.
struct PoseConstraint {
  std::size_t from = 0;
  std::size_t to = 0;
  Pose2 T_from_to;
  /// Inverse covariance of (x, y [m], yaw [rad]) in the axes of `from`; may be singular.
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();
  /// May be wrong altogether (a loop closure); others are taken at their word.
  bool doubtful = false;
};

/// Difference of a constraint and the present poses: (x, y) in the axes of `from`, yaw wrapped.
[[nodiscard]] Eigen::Vector3d residual(
    const PoseConstraint& constraint, const std::vector<Pose2>& poses);

struct PoseGraphParams {
  int max_iterations = 30;    ///< of Gauss-Newton between two changes of the weights
  double inlier_chi2 = 11.3;  ///< squared error of a doubtful constraint that is still believed
};

struct PoseGraphResult {
  std::vector<Pose2> poses;
  /// Per constraint: 1 = fully believed, near 0 = voted out. 1 for all that are not doubtful.
  std::vector<double> weights;
  double chi2 = 0.0;  ///< weighted sum of squared errors
  int iterations = 0;
};

/// Poses that fit the constraints best. Doubtful ones are weighed by graduated non-convexity with
/// the Geman-McClure function (after Yang et al., RA-L 2020): first all speak, but softly, then
/// louder and more and more robustly, so that the minority falls silent. The first node stays where
/// it is.
/// \pre every node hangs together with the first by constraints that are not doubtful
[[nodiscard]] PoseGraphResult optimisePoseGraph(
    std::vector<Pose2> poses,
    const std::vector<PoseConstraint>& constraints,
    const PoseGraphParams& params = {});

/// The quadratic of one pair of nodes in the change of T_from_to = (x, y, yaw), at the present
/// poses: g' d + d' H d / 2.
struct PairQuadratic {
  std::size_t from = 0;
  std::size_t to = 0;
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
};

/// The poses after one damped Newton step on the sum of the quadratics; the first node stays.
/// `damping` is added to the diagonal in units of 1/m^2 and 1/rad^2.
[[nodiscard]] std::vector<Pose2> stepped(
    const std::vector<Pose2>& poses, const std::vector<PairQuadratic>& pairs, double damping);

/// VERTEX_SE2 and EDGE_SE2 lines as g2o reads them.
[[nodiscard]] std::string g2oOf(
    const std::vector<Pose2>& poses, const std::vector<PoseConstraint>& constraints);

}  // namespace vestibule::mapping
