#pragma once

#include <mrpt/math/TPoint2D.h>
#include <mrpt/math/TPose2D.h>
#include <mrpt/math/TPose3D.h>

#include <Eigen/Core>

namespace vestibule {

/// Poses are MRPT values. `T_a_b` is the pose of frame b in frame a: it takes b-coordinates to a.
/// Yaw (`phi`) is counter-clockwise from the x axis, wrapped to [-pi, pi] by every function here.
using Pose2 = mrpt::math::TPose2D;
using Pose3 = mrpt::math::TPose3D;
using Point2 = mrpt::math::TPoint2D;

/// Geodetic position on WGS-84. `height_m` is above the ellipsoid where the source says so.
struct Geodetic {
  double lat_deg = 0.0;
  double lon_deg = 0.0;
  double height_m = 0.0;
};

/// SE(2) pose with covariance. `cov` orders x, y [m], yaw [rad], all expressed in frame a of T_a_b
/// (x and y along a's axes; yaw is the same in both frames).
struct PoseWithCovariance {
  Pose2 mean;
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
};

/// T_a_c = T_a_b * T_b_c.
[[nodiscard]] Pose2 compose(const Pose2& T_a_b, const Pose2& T_b_c);
/// T_b_a.
[[nodiscard]] Pose2 inverse(const Pose2& T_a_b);
/// T_b_c, the pose of c seen from b, from two poses in the same frame a.
[[nodiscard]] Pose2 between(const Pose2& T_a_b, const Pose2& T_a_c);
/// p_a of a point given in b.
[[nodiscard]] Point2 transform(const Pose2& T_a_b, const Point2& p_b);

/// T_a_c with the covariance of T_a_b carried to c; T_b_c is exact. First order.
[[nodiscard]] PoseWithCovariance compose(const PoseWithCovariance& T_a_b, const Pose2& T_b_c);
/// T_a_c with the covariance of T_b_c expressed in a; T_a_b is exact.
[[nodiscard]] PoseWithCovariance compose(const Pose2& T_a_b, const PoseWithCovariance& T_b_c);

/// Exponential map of SE(2): the pose reached by the constant body twist (x, y [m], yaw [rad]).
[[nodiscard]] Pose2 expSe2(const Eigen::Vector3d& twist);
/// Inverse of expSe2 for |yaw| < pi.
[[nodiscard]] Eigen::Vector3d logSe2(const Pose2& T);
/// The pose at fraction s in [0, 1] of the constant-twist motion from T_a_b to T_a_c.
[[nodiscard]] Pose2 interpolate(const Pose2& T_a_b, const Pose2& T_a_c, double s);

[[nodiscard]] double translationNorm(const Pose2& T);
[[nodiscard]] double distance(const Pose2& a, const Pose2& b);
[[nodiscard]] bool isFinite(const Pose2& T);

/// Planar pose in 3D (z = roll = pitch = 0), and the projection back (x, y, yaw).
[[nodiscard]] Pose3 toPose3(const Pose2& T);
[[nodiscard]] Pose2 toPose2(const Pose3& T);

}  // namespace vestibule
