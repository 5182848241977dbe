#include "motion_model.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace vestibule::amcl {

PoseWithCovariance likelyMotion(const Motion& motion, const MotionNoise& noise) {
  const double d = motion.travelled_m;
  const double wheel_turn = std::max(0.0, motion.turned_rad - motion.gyro_rad);
  const auto squared = [](double a) { return a * a; };

  PoseWithCovariance result;
  result.mean = motion.T_from_to;
  double along = squared(noise.trans_per_trans * d) +
                 squared(noise.trans_per_rot * motion.turned_rad) + squared(noise.min_trans_m) +
                 squared(motion.timing_m);
  double across = squared(noise.min_trans_m);
  switch (noise.model) {
    case MotionModel::kDifferential:
      across += squared(noise.lateral_per_trans * d);
      break;
    case MotionModel::kOmni:
      across +=
          squared(noise.trans_per_trans * d) + squared(noise.trans_per_rot * motion.turned_rad);
      break;
    case MotionModel::kSkidSteer:
      // The robot turns about a point off its base frame's y axis: the base slips sideways.
      result.mean =
          compose(motion.T_from_to, Pose2{0.0, -motion.T_from_to.phi * noise.icr_x_m, 0.0});
      across +=
          squared(noise.lateral_per_trans * d) + squared(noise.lateral_per_rot * motion.turned_rad);
      break;
  }
  const double gyro_share =
      motion.turned_rad > 0.0 ? std::min(1.0, motion.gyro_rad / motion.turned_rad) : 0.0;
  const double turn = squared(noise.rot_per_trans * d * (1.0 - gyro_share)) +
                      squared(noise.rot_per_rot * wheel_turn) +
                      squared(noise.gyro_rot_per_rot * motion.gyro_rad) +
                      squared(noise.min_rot_rad);

  // A wrong turn on the way leaves the robot beside its path: on average half of it counts.
  const double half_m = 0.5 * translationNorm(motion.T_from_to);
  Eigen::Matrix3d path = Eigen::Matrix3d::Zero();
  path(0, 0) = along;
  path(1, 1) = across + half_m * half_m * turn;
  path(1, 2) = path(2, 1) = half_m * turn;
  path(2, 2) = turn;
  const double direction = half_m > 1e-6 ? std::atan2(motion.T_from_to.y, motion.T_from_to.x)
                                         : 0.5 * motion.T_from_to.phi;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  R(0, 0) = R(1, 1) = std::cos(direction);
  R(1, 0) = std::sin(direction);
  R(0, 1) = -R(1, 0);
  result.cov = R * path * R.transpose();
  return result;
}

NoisyIncrement noisyIncrement(const PoseWithCovariance& increment) {
  const Eigen::Matrix3f L = increment.cov.llt().matrixL().toDenseMatrix().cast<float>();
  NoisyIncrement result;
  result.mean = {
      static_cast<float>(increment.mean.x),
      static_cast<float>(increment.mean.y),
      static_cast<float>(increment.mean.phi)};
  result.factor = {L(0, 0), L(1, 0), L(1, 1), L(2, 0), L(2, 1), L(2, 2)};
  return result;
}

}  // namespace vestibule::amcl
