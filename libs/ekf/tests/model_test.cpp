#include "vestibule/ekf/model.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <functional>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::ekf {
namespace {

State randomState(RandomStream& random) {
  State x;
  x << random.normal(0, 50), random.normal(0, 50), random.uniform(-3.0, 3.0),
      random.normal(0, 0.01), random.normal(0, 0.1), random.uniform(-2.0, 2.0),
      random.normal(0, 0.2);
  return x;
}

Motion randomMotion(RandomStream& random, bool gyro) {
  Motion u;
  u.dt_s = 0.1;
  u.forward_m = random.normal(0, 0.3);
  u.left_m = random.normal(0, 0.1);
  u.turn_rad = random.normal(0, 0.2);
  u.turn_is_gyro = gyro;
  u.forward_var = 1e-4;
  u.left_var = 4e-5;
  u.turn_var = 1e-5;
  u.disturbance_decay = 0.97;
  u.disturbance_var = 1e-3;
  return u;
}

/// d(-residual)/dx by central differences: the residual is z - h(x).
template <class Observe>
Eigen::MatrixXd numericJacobian(const State& x, const Observe& observe) {
  const double step = 1e-6;
  Eigen::MatrixXd H(observe(x).residual.size(), kStateSize);
  for (int i = 0; i < kStateSize; ++i) {
    State forward = x;
    State back = x;
    forward[i] += step;
    back[i] -= step;
    H.col(i) = (observe(back).residual - observe(forward).residual) / (2.0 * step);
  }
  return H;
}

TEST(PlanarModel, TransitionJacobianIsTheNumericOne) {
  RandomStream random(1, "model");
  for (int n = 0; n < 50; ++n) {
    const State x = randomState(random);
    const Motion u = randomMotion(random, n % 2 == 0);
    const StateMatrix F = PlanarModel::jacobian(x, u);
    for (int i = 0; i < kStateSize; ++i) {
      State forward = x;
      State back = x;
      forward[i] += 1e-6;
      back[i] -= 1e-6;
      State difference = PlanarModel::transition(forward, u) - PlanarModel::transition(back, u);
      difference[kYaw] = wrapToPi(difference[kYaw]);
      EXPECT_LT((difference / 2e-6 - F.col(i)).norm(), 1e-6) << "column " << i;
    }
  }
}

TEST(PlanarModel, ObservationJacobiansAreTheNumericOnes) {
  RandomStream random(2, "model");
  for (int n = 0; n < 50; ++n) {
    const State x = randomState(random);
    const auto gnss = [](const State& s) {
      return PlanarModel::gnss(s, {3.0, 4.0}, {1.0, -0.4}, Eigen::Matrix2d::Identity());
    };
    EXPECT_LT((numericJacobian(x, gnss) - gnss(x).H).norm(), 1e-6);
    const double yaw = x[kYaw] + x[kHeadingOffset] + 0.3;
    const auto heading = [yaw](const State& s) { return PlanarModel::heading(s, yaw, 0.1); };
    EXPECT_LT((numericJacobian(x, heading) - heading(x).H).norm(), 1e-6);
    PoseWithCovariance T{Pose2(1, 2, wrapToPi(x[kYaw] - 0.4)), Eigen::Matrix3d::Identity()};
    const auto pose = [&T](const State& s) { return PlanarModel::pose(s, T); };
    EXPECT_LT((numericJacobian(x, pose) - pose(x).H).norm(), 1e-6);
    const auto still = [](const State& s) { return PlanarModel::zeroRate(s, 0.01, 0.1); };
    EXPECT_LT((numericJacobian(x, still) - still(x).H).norm(), 1e-6);
  }
}

TEST(PlanarModel, ResidualsOfAnglesAreWrapped) {
  State x = State::Zero();
  x[kYaw] = 3.1;
  EXPECT_NEAR(PlanarModel::heading(x, -3.1, 0.1).residual[0], 2 * kPi - 6.2, 1e-9);
}

TEST(PlanarModel, ProcessNoiseIsPositiveSemidefinite) {
  RandomStream random(3, "model");
  for (int n = 0; n < 50; ++n) {
    const StateMatrix Q =
        PlanarModel::processNoise(randomState(random), randomMotion(random, true));
    EXPECT_LT((Q - Q.transpose()).norm(), 1e-15);
    EXPECT_GE(Eigen::SelfAdjointEigenSolver<StateMatrix>(Q).eigenvalues().minCoeff(), -1e-15);
  }
}

TEST(PlanarModel, DrivesAnArcAlongItsChord) {
  State x = State::Zero();
  Motion u;
  u.turn_rad = kPi / 2;
  u.forward_m = std::sqrt(2.0);  // chord of a quarter circle of radius 1
  const State next = PlanarModel::transition(x, u);
  EXPECT_NEAR(next[kX], 1.0, 1e-12);
  EXPECT_NEAR(next[kY], 1.0, 1e-12);
  EXPECT_NEAR(next[kYaw], kPi / 2, 1e-12);
}

}  // namespace
}  // namespace vestibule::ekf
