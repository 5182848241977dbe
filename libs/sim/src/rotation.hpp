#pragma once

#include <Eigen/Geometry>

#include "vestibule/core/frames.hpp"

namespace vestibule::sim {

/// Yaw about z, then pitch about y (nose down positive), then roll about x.
[[nodiscard]] inline Eigen::Matrix3d rotationOf(const Pose3& T) {
  return (Eigen::AngleAxisd(T.yaw, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(T.pitch, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(T.roll, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

[[nodiscard]] inline Eigen::Vector3d positionOf(const Pose3& T) { return {T.x, T.y, T.z}; }

}  // namespace vestibule::sim
