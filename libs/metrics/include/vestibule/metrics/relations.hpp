#pragma once

#include <cstddef>
#include <istream>
#include <string>
#include <vector>

#include "vestibule/metrics/trajectory.hpp"

namespace vestibule::metrics {

/// A verified relative pose between two moments: T_first_second.
struct Relation {
  Timestamp first;
  Timestamp second;
  Pose2 T_first_second;
};

/// Lines `t1 t2 x y z roll pitch yaw` [s, m, rad]; empty lines and lines starting with '#' are
/// skipped. The planar part is kept. Throws InputError with `name`:line for anything else.
[[nodiscard]] std::vector<Relation> parseRelations(std::istream& in, const std::string& name);

/// Kuemmerle et al., "On measuring the accuracy of SLAM algorithms", 2009:
/// e_ij = (x_j (-) x_i) (-) delta_ij.
struct RelationErrors {
  Statistics translation_m;
  Statistics yaw_rad;
  std::size_t relations = 0;  ///< given
  std::size_t matched = 0;    ///< of these, with both ends in the trajectory
};
[[nodiscard]] RelationErrors relationErrors(
    const Trajectory& estimate,
    const std::vector<Relation>& relations,
    Duration max_dt = std::chrono::milliseconds(10));

}  // namespace vestibule::metrics
