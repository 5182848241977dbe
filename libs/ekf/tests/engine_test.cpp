#include "vestibule/ekf/engine.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::ekf {
namespace {

/// The textbook equations, as the yardstick.
struct Textbook {
  State x = State::Zero();
  StateMatrix P = StateMatrix::Identity();
  void predict(const Motion& u) {
    const StateMatrix F = PlanarModel::jacobian(x, u);
    P = F * P * F.transpose() + PlanarModel::processNoise(x, u);
    x = PlanarModel::transition(x, u);
  }
  void update(const Observation& z) {
    const Eigen::MatrixXd S = z.H * P * z.H.transpose() + z.R;
    const Eigen::MatrixXd K = P * z.H.transpose() * S.inverse();
    x += K * z.residual;
    x[kYaw] = wrapToPi(x[kYaw]);
    const StateMatrix A = StateMatrix::Identity() - K * z.H;
    P = A * P * A.transpose() + K * z.R * K.transpose();
  }
};

TEST(MrptEngine, AgreesWithTheTextbookForOneTwoAndThreeRows) {
  RandomStream random(7, "engine");
  const auto engine = makeMrptEngine();
  Textbook textbook;
  textbook.P.diagonal() << 4, 4, 0.1, 1e-4, 1e-3, 0.2, 0.05;
  engine->set(textbook.x, textbook.P);
  for (int n = 0; n < 300; ++n) {
    Motion u;
    u.dt_s = 0.1;
    u.forward_m = 0.1;
    u.turn_rad = 0.02;
    u.turn_is_gyro = true;
    u.forward_var = 1e-4;
    u.left_var = 1e-4;
    u.turn_var = 1e-5;
    u.disturbance_decay = 0.99;
    u.disturbance_var = 1e-4;
    textbook.predict(u);
    engine->predict(u);
    Observation z;
    if (n % 3 == 0) {
      z = PlanarModel::heading(textbook.x, random.normal(0, 0.3), 0.1);
    } else if (n % 3 == 1) {
      Eigen::Matrix2d R;
      R << 1.0, 0.3, 0.3, 0.5;
      z = PlanarModel::gnss(textbook.x, {random.normal(), random.normal()}, {1.0, 0.2}, R);
    } else {
      PoseWithCovariance T{Pose2(random.normal(), random.normal(), random.normal(0, 0.2)), {}};
      T.cov << 0.5, 0.1, 0.02, 0.1, 0.4, 0.01, 0.02, 0.01, 0.05;
      z = PlanarModel::pose(textbook.x, T);
    }
    textbook.update(z);
    engine->update(z);
    ASSERT_LT((engine->state() - textbook.x).norm(), 1e-9) << "step " << n;
    ASSERT_LT((engine->covariance() - textbook.P).norm(), 1e-9) << "step " << n;
  }
}

TEST(MrptEngine, CovarianceStaysSymmetricAndPositive) {
  const auto engine = makeMrptEngine();
  StateMatrix P = StateMatrix::Identity() * 1e4;
  engine->set(State::Zero(), P);
  for (int n = 0; n < 2000; ++n) {
    Motion u;
    u.dt_s = 0.01;
    u.forward_m = 0.01;
    u.forward_var = 1e-10;
    u.turn_var = 1e-12;
    u.turn_is_gyro = true;
    engine->predict(u);
    engine->update(PlanarModel::gnss(
        engine->state(), {0.01 * n, 0.0}, {0.5, 0.0}, Eigen::Matrix2d::Identity() * 1e-4));
    engine->update(PlanarModel::heading(engine->state(), 0.0, 1e-3));
  }
  P = engine->covariance();
  EXPECT_EQ((P - P.transpose()).norm(), 0.0);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<StateMatrix>(P).eigenvalues().minCoeff(), -1e-12);
}

}  // namespace
}  // namespace vestibule::ekf
