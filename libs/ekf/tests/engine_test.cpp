#include "vestibule/ekf/engine.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "random_models.hpp"

namespace vestibule::ekf {
namespace {

/// The textbook equations with the Joseph form, as the yardstick.
struct Textbook {
  StateMatrix P;
  void predict(const Transition& step) { P = step.F() * P * step.F().transpose() + step.Q(); }
  Error update(const Observation& z) {
    const Eigen::MatrixXd H = z.H.topRows(z.rows);
    const Eigen::MatrixXd R = z.R.topLeftCorner(z.rows, z.rows);
    const Eigen::MatrixXd S = H * P * H.transpose() + R;
    const Eigen::MatrixXd K = P * H.transpose() * S.inverse();
    const StateMatrix A = StateMatrix::Identity() - K * H;
    P = A * P * A.transpose() + K * R * K.transpose();
    return K * z.residual.head(z.rows);
  }
};

Observation randomObservation(RandomStream& random, const Model& model, const State& x, int kind) {
  Eigen::Matrix3d R;
  R << 1.0, 0.3, 0.1, 0.3, 0.5, 0.0, 0.1, 0.0, 2.0;
  switch (kind % 5) {
    case 0:
      return model.heading(x, random.normal(0, 0.3), 0.1);
    case 1:
      return model.gnssPosition(
          x, x.p + Eigen::Vector3d(random.normal(), random.normal(), 0.0), {1.0, 0.2, 0.0}, R);
    case 2: {
      PoseWithCovariance T{x.pose2(), {}};
      T.mean.x += random.normal();
      T.cov << 0.5, 0.1, 0.02, 0.1, 0.4, 0.01, 0.02, 0.01, 0.05;
      return model.pose(x, T);
    }
    case 3:
      return model.zeroRate(x, {0.01, -0.01, 0.02}, 0.01);
    default:
      return model.wheelTurn(x, 0.1, 0.08, 0.2, 0.1, 0.01);
  }
}

struct Case {
  bool mrpt;
  bool planar;
};
class EngineOf : public testing::TestWithParam<Case> {};

TEST_P(EngineOf, AgreesWithTheTextbook) {
  RandomStream random(7, "engine");
  const Model model(GetParam().planar);
  const auto engine = GetParam().mrpt ? makeMrptEngine() : makeFixedEngine(GetParam().planar);
  Textbook textbook{someCovariance(model)};
  StateMatrix P = textbook.P;
  State x = randomState(random, model.planar());
  for (int n = 0; n < 300; ++n) {
    const auto predicted = model.predict(x, randomMotion(random, model.planar(), n));
    x = predicted.x;
    textbook.predict(predicted.step);
    engine->predict(P, predicted.step);
    ASSERT_LT((P - textbook.P).norm(), 1e-9) << "prediction " << n;
    const Observation z = randomObservation(random, model, x, n);
    const Correlation c = Engine::correlation(P, z);
    const double nis = Engine::innovation(z, c).nis;
    const Eigen::MatrixXd H = z.H.topRows(z.rows);
    const Eigen::MatrixXd S = H * textbook.P * H.transpose() + z.R.topLeftCorner(z.rows, z.rows);
    const Eigen::VectorXd r = z.residual.head(z.rows);
    ASSERT_NEAR(nis, r.dot(S.inverse() * r), 1e-9 * (1.0 + nis)) << "step " << n;
    const Error expected = textbook.update(z);
    const Error correction = engine->update(P, z, c);
    ASSERT_LT((correction - expected).norm(), 1e-9) << "update " << n;
    ASSERT_LT((P - textbook.P).norm(), 1e-9) << "update " << n;
    x = plus(x, correction);
  }
}

TEST_P(EngineOf, CovarianceStaysSymmetricAndPositiveUnderExtremes) {
  // From knowing nothing to millimetres and back, thousands of times.
  RandomStream random(8, "engine");
  const Model model(GetParam().planar);
  const auto engine = GetParam().mrpt ? makeMrptEngine() : makeFixedEngine(GetParam().planar);
  StateMatrix P = 1e8 * StateMatrix::Identity();
  model.constrain(P);
  State x = randomState(random, model.planar());
  for (int n = 0; n < 2000; ++n) {
    Motion u = randomMotion(random, model.planar(), n);
    if (n % 100 == 0) u.forward_var = 1e10;
    const auto predicted = model.predict(x, u);
    engine->predict(P, predicted.step);
    Observation z = randomObservation(random, model, x, n);
    z.R *= 1e-8;
    (void)engine->update(P, z);
    if (n % 10 != 0) continue;
    ASSERT_EQ((P - P.transpose()).norm(), 0.0);
    const Eigen::SelfAdjointEigenSolver<StateMatrix> eigen(P);
    ASSERT_GE(eigen.eigenvalues().minCoeff(), -1e-12 * eigen.eigenvalues().maxCoeff());
    ASSERT_GE(P.diagonal().minCoeff(), 0.0);
  }
}

TEST(FixedEngine, GivesTheSameBitsOnEveryMachine) {
  if (bestSimd() == Simd::kPortable) GTEST_SKIP() << "nothing else to compare with";
  for (const bool planar : {true, false}) {
    RandomStream random(9, "engine");
    const Model model(planar);
    const auto portable = makeFixedEngine(planar, Simd::kPortable);
    const auto best = makeFixedEngine(planar);
    StateMatrix P = someCovariance(model);
    StateMatrix same = P;
    State x = randomState(random, planar);
    for (int n = 0; n < 300; ++n) {
      const auto predicted = model.predict(x, randomMotion(random, planar, n));
      x = predicted.x;
      portable->predict(P, predicted.step);
      best->predict(same, predicted.step);
      ASSERT_EQ(P, same) << "prediction " << n;
      const Observation z = randomObservation(random, model, x, n);
      const Error correction = portable->update(P, z);
      ASSERT_EQ(correction, best->update(same, z)) << "update " << n;
      ASSERT_EQ(P, same) << "update " << n;
      x = plus(x, correction);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    All,
    EngineOf,
    testing::Values(Case{false, true}, Case{false, false}, Case{true, true}, Case{true, false}),
    [](const auto& each) {
      return std::string(each.param.mrpt ? "mrpt" : "fixed") +
             (each.param.planar ? "_plane" : "_space");
    });

}  // namespace
}  // namespace vestibule::ekf
