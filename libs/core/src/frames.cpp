#include "vestibule/core/frames.hpp"

#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule {
namespace {

// sin(t)/t and (1-cos(t))/t with their series where the quotient loses digits.
struct ExpCoefficients {
  double a;
  double b;
};

ExpCoefficients expCoefficients(double t) {
  if (std::abs(t) < 1e-4) {
    return {1.0 - t * t / 6.0, t / 2.0 - t * t * t / 24.0};
  }
  return {std::sin(t) / t, (1.0 - std::cos(t)) / t};
}

}  // namespace

Pose2 compose(const Pose2& T_a_b, const Pose2& T_b_c) {
  const double c = std::cos(T_a_b.phi);
  const double s = std::sin(T_a_b.phi);
  return {
      T_a_b.x + c * T_b_c.x - s * T_b_c.y,
      T_a_b.y + s * T_b_c.x + c * T_b_c.y,
      wrapToPi(T_a_b.phi + T_b_c.phi)};
}

Pose2 inverse(const Pose2& T_a_b) {
  const double c = std::cos(T_a_b.phi);
  const double s = std::sin(T_a_b.phi);
  return {-c * T_a_b.x - s * T_a_b.y, s * T_a_b.x - c * T_a_b.y, wrapToPi(-T_a_b.phi)};
}

Pose2 between(const Pose2& T_a_b, const Pose2& T_a_c) {
  const double c = std::cos(T_a_b.phi);
  const double s = std::sin(T_a_b.phi);
  const double dx = T_a_c.x - T_a_b.x;
  const double dy = T_a_c.y - T_a_b.y;
  return {c * dx + s * dy, -s * dx + c * dy, angleDiff(T_a_c.phi, T_a_b.phi)};
}

Point2 transform(const Pose2& T_a_b, const Point2& p_b) {
  const double c = std::cos(T_a_b.phi);
  const double s = std::sin(T_a_b.phi);
  return {T_a_b.x + c * p_b.x - s * p_b.y, T_a_b.y + s * p_b.x + c * p_b.y};
}

PoseWithCovariance compose(const PoseWithCovariance& T_a_b, const Pose2& T_b_c) {
  const double c = std::cos(T_a_b.mean.phi);
  const double s = std::sin(T_a_b.mean.phi);
  Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
  J(0, 2) = -s * T_b_c.x - c * T_b_c.y;
  J(1, 2) = c * T_b_c.x - s * T_b_c.y;
  return {compose(T_a_b.mean, T_b_c), J * T_a_b.cov * J.transpose()};
}

PoseWithCovariance compose(const Pose2& T_a_b, const PoseWithCovariance& T_b_c) {
  const double c = std::cos(T_a_b.phi);
  const double s = std::sin(T_a_b.phi);
  Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
  J.topLeftCorner<2, 2>() << c, -s, s, c;
  return {compose(T_a_b, T_b_c.mean), J * T_b_c.cov * J.transpose()};
}

Pose2 expSe2(const Eigen::Vector3d& twist) {
  const auto [a, b] = expCoefficients(twist.z());
  return {a * twist.x() - b * twist.y(), b * twist.x() + a * twist.y(), wrapToPi(twist.z())};
}

Eigen::Vector3d logSe2(const Pose2& T) {
  const double yaw = wrapToPi(T.phi);
  const auto [a, b] = expCoefficients(yaw);
  const double det = a * a + b * b;
  return {(a * T.x + b * T.y) / det, (-b * T.x + a * T.y) / det, yaw};
}

Pose2 interpolate(const Pose2& T_a_b, const Pose2& T_a_c, double s) {
  return compose(T_a_b, expSe2(s * logSe2(between(T_a_b, T_a_c))));
}

double translationNorm(const Pose2& T) { return std::hypot(T.x, T.y); }

double distance(const Pose2& a, const Pose2& b) { return std::hypot(a.x - b.x, a.y - b.y); }

bool isFinite(const Pose2& T) {
  return std::isfinite(T.x) && std::isfinite(T.y) && std::isfinite(T.phi);
}

Pose3 toPose3(const Pose2& T) { return {T.x, T.y, 0.0, T.phi, 0.0, 0.0}; }

Pose2 toPose2(const Pose3& T) { return {T.x, T.y, wrapToPi(T.yaw)}; }

}  // namespace vestibule
