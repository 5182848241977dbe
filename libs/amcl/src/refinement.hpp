#pragma once

#include <Eigen/Core>
#include <vector>

#include "vestibule/amcl/params.hpp"
#include "vestibule/core/frames.hpp"
#include "vestibule/grid/distance_field.hpp"

namespace vestibule::amcl {

/// Pose and wall offset (see refine()) with their joint covariance: x, y [m], yaw [rad], offset
/// [m].
struct TrackState {
  Pose2 T_grid_base;
  double wall_offset_m = 0.0;
  Eigen::Matrix4d cov = Eigen::Matrix4d::Identity();
};

/// A scan laid onto the map to a fraction of a cell, weighed against what was known before.
struct Refinement {
  TrackState state;
  Eigen::Matrix3d scan_information;  ///< what the scan alone says of the pose, grid axes
  double residual_sigma_m = 0.0;     ///< spread of the fitting beams about the mapped surfaces
  double cost = 0.0;                 ///< minus the log of scan likelihood and prior density
  double correction_chi2 = 0.0;      ///< squared Mahalanobis distance from the prior, 4 dof
  double fitting_share = 0.0;        ///< sum of the beams' weights / beams
  bool converged = false;
};

/// Minimises sum w ((s - offset) / sigma)^2 / 2 over the beam ends, plus the squared Mahalanobis
/// distance to the prior / 2, by Gauss-Newton. s is the bilinear distance to the nearest mapped
/// obstacle, positive on the side the beam comes from; w the probability that the beam hit
/// something mapped. Where the scan says nothing (along a corridor) the prior decides, so nothing
/// needs to be cut off.
///
/// The offset is where surfaces lie in front of the middle of their cells. It is not zero: mapping
/// wears off the near side of walls, or thickens it, by about a cell, and a robot that looks ahead
/// would be wrong by as much. It is the same for the whole map, and walls to all sides tell it
/// apart from the pose.
///
/// \param ends beam ends in base axes [m]
/// \param p_base_laser where the beams start
/// \param prior its covariance must be positive definite
/// \param start where the search begins
/// \param residual_sigma_m expected spread of fitting beams
[[nodiscard]] Refinement refine(
    const grid::DistanceField& field,
    const std::vector<Point2>& ends,
    const Point2& p_base_laser,
    const TrackState& prior,
    const Pose2& start,
    double residual_sigma_m,
    const RefinementParams& params);

}  // namespace vestibule::amcl
