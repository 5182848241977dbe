#include "vestibule/ekf/smoother.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "random_models.hpp"
#include "vestibule/ekf/engine.hpp"

namespace vestibule::ekf {
namespace {

/// A linear problem of which everything is known: the smoothed estimate must be the one of all
/// measurements at once.
TEST(Smoother, EqualsTheBatchSolution) {
  RandomStream random(11, "smoother");
  const Model model(true);
  const auto engine = makeFixedEngine(true);
  constexpr int kSteps = 12;

  // Batch: the error at the start and the noise of each step as unknowns, by least squares on the
  // errors themselves (all states have zero mean).
  StateMatrix P = someCovariance(model);
  P.diagonal().array() += 1e-6;  // regular, so that the batch problem can be inverted
  const StateMatrix P0 = P;
  std::vector<StateMatrix> F;
  std::vector<StateMatrix> Q;
  std::vector<Observation> z;
  Smoother smoother;
  State x;  // stays at the origin: residuals are those of the error, which the model is linear in
  Error mean = Error::Zero();
  smoother.mark(Timestamp{0}, x, P);
  for (int k = 0; k < kSteps; ++k) {
    const Transition step = model.predict({}, randomMotion(random, true, k)).step;
    F.push_back(step.F());
    Q.push_back(step.Q() + 1e-9 * StateMatrix::Identity());
    Transition regular = step;
    regular.top_noise += 1e-9 * Eigen::Matrix<double, 9, 9>::Identity();
    regular.rest_noise.array() += 1e-9;
    smoother.predicted(regular);
    engine->predict(P, regular);
    mean = F.back() * mean;
    Observation o = model.gnssPosition(
        {}, {random.normal(), random.normal(), 0}, {0.5, 0.2, 0}, Eigen::Matrix3d::Identity());
    z.push_back(o);
    o.residual.head<2>() -= o.H.topRows<2>() * mean;
    smoother.updated(P, o);
    mean += engine->update(P, o);
    smoother.mark(Timestamp{k + 1}, x, P);
  }
  constexpr int n = kStateSize;
  const int size = n * (kSteps + 1);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(size);
  A.topLeftCorner(n, n) = P0.inverse();
  for (int k = 0; k < kSteps; ++k) {
    const Eigen::MatrixXd W = Q[static_cast<std::size_t>(k)].inverse();
    const Eigen::MatrixXd& Fk = F[static_cast<std::size_t>(k)];
    A.block(n * k, n * k, n, n) += Fk.transpose() * W * Fk;
    A.block(n * k, n * (k + 1), n, n) -= Fk.transpose() * W;
    A.block(n * (k + 1), n * k, n, n) -= W * Fk;
    const auto& o = z[static_cast<std::size_t>(k)];
    A.block(n * (k + 1), n * (k + 1), n, n) += W + o.H.topRows<2>().transpose() * o.H.topRows<2>();
    b.segment(n * (k + 1), n) += o.H.topRows<2>().transpose() * o.residual.head<2>();
  }
  const Eigen::MatrixXd covariance = A.inverse();
  const Eigen::VectorXd batch = covariance * b;

  // The filter's own means, to compare corrections: run it again.
  const auto smoothed = smoother.smooth();
  Error filtered = Error::Zero();
  P = P0;
  for (int k = 0; k <= kSteps; ++k) {
    if (k > 0) {
      const auto i = static_cast<std::size_t>(k - 1);
      filtered = F[i] * filtered;
      P = F[i] * P * F[i].transpose() + Q[i];
      Observation o = z[i];
      o.residual.head<2>() -= o.H.topRows<2>() * filtered;
      filtered += engine->update(P, o);
    }
    const auto& s = smoothed[static_cast<std::size_t>(k)];
    const Error correction = minus(s.x, x);
    // Attitudes compose instead of adding: small enough here to be the same to 1e-3.
    for (const int i : {0, 1, 3, 4, 11, 15, 19, 20}) {
      EXPECT_NEAR(filtered[i] + correction[i], batch[n * k + i], 1e-6)
          << "state " << i << ", " << k;
      EXPECT_NEAR(s.P(i, i), covariance(n * k + i, n * k + i), 1e-6) << "state " << i << ", " << k;
    }
  }
}

}  // namespace
}  // namespace vestibule::ekf
