#include "vestibule/ekf/model.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <functional>
#include <limits>

#include "random_models.hpp"
#include "vestibule/core/angles.hpp"

namespace vestibule::ekf {
namespace {

constexpr double kStep = 1e-6;

/// Columns that a model in the plane leaves alone.
bool exists(const Model& model, int index) {
  StateMatrix P = StateMatrix::Identity();
  model.constrain(P);
  return P(index, index) != 0.0;
}

/// d(-residual)/d(error) by central differences: the residual is z - h(x).
Eigen::MatrixXd numericJacobian(
    const Model& model, const State& x, const std::function<Observation(const State&)>& observe) {
  const int rows = observe(x).rows;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(rows, kStateSize);
  for (int i = 0; i < kStateSize; ++i) {
    if (!exists(model, i)) continue;
    const Error step = Error::Unit(i) * kStep;
    H.col(i) = (observe(plus(x, -step)).residual - observe(plus(x, step)).residual).head(rows) /
               (2.0 * kStep);
  }
  return H;
}

TEST(State, PlusAndMinusAreInverse) {
  RandomStream random(1, "state");
  for (int n = 0; n < 50; ++n) {
    const State a = randomState(random, false);
    const State b = randomState(random, false);
    const Error e = minus(b, a);
    EXPECT_LT(minus(plus(a, e), b).norm(), 1e-9);
  }
}

TEST(State, GivesYawPitchAndRollBack) {
  State x;
  x.q = attitudeOf(2.5, 0.2, -0.3);
  EXPECT_NEAR(x.yaw(), 2.5, 1e-12);
  EXPECT_NEAR(x.pose3().pitch, 0.2, 1e-12);
  EXPECT_NEAR(x.pose3().roll, -0.3, 1e-12);
}

TEST(State, RotationExpIsExactOnBothSidesOfItsSeries) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1.0, -2.0, 0.5).normalized();
  for (const double angle : {0.0, 1e-9, 1e-4, 0.01, 0.0499, 0.0501, 0.5, 3.0}) {
    const Eigen::Quaterniond expected(Eigen::AngleAxisd(angle, axis));
    EXPECT_LT((rotationExp(angle * axis).coeffs() - expected.coeffs()).norm(), 3e-16) << angle;
  }
}

class ModelOf : public testing::TestWithParam<bool> {
 protected:
  Model model{GetParam()};
};

TEST_P(ModelOf, StepsTakenTogetherChangeTheCovarianceAsOneByOne) {
  RandomStream random(4, "steps");
  const StateMatrix P0 = someCovariance(model);
  for (int n = 0; n < 20; ++n) {
    State x = randomState(random, model.planar());
    // A robot that keeps going for a tenth of a second.
    Motion u = randomMotion(random, model.planar(), n % 2);
    u.forward_m = 0.02;
    u.left_m = 0.0;
    u.turn_rad.z() = random.normal(0, 0.01);
    const State from = x;
    Motion together = u;
    StateMatrix P = P0;
    for (int k = 0; k < 5; ++k) {
      const Model::Predicted predicted = model.predict(x, u);
      const StateMatrix F = predicted.step.F();
      P = F * P * F.transpose() + predicted.step.Q();
      x = predicted.x;
      if (k == 0) continue;
      ASSERT_TRUE(together.continuedBy(u));
      together.append(u);
    }
    const Transition step = model.predict(from, together).step;
    const StateMatrix P_together = step.F() * P0 * step.F().transpose() + step.Q();
    // Of the product of the standard deviations: a share of a per cent of any variance.
    const Error sigma = P.diagonal().cwiseSqrt().cwiseMax(1e-12);
    const StateMatrix off =
        sigma.cwiseInverse().asDiagonal() * (P_together - P) * sigma.cwiseInverse().asDiagonal();
    EXPECT_LT(off.cwiseAbs().maxCoeff(), 0.01) << "motion " << n;
  }
}

TEST_P(ModelOf, TransitionJacobianIsTheNumericOne) {
  RandomStream random(2, "model");
  for (int n = 0; n < 60; ++n) {
    const State x = randomState(random, model.planar());
    const Motion u = randomMotion(random, model.planar(), n);
    const auto predicted = model.predict(x, u);
    const StateMatrix F = predicted.step.F();
    EXPECT_EQ(minus(predicted.x, model.transition(x, u)).norm(), 0.0);
    for (int i = 0; i < kStateSize; ++i) {
      if (!exists(model, i)) continue;
      const Error step = Error::Unit(i) * kStep;
      const State forward = model.transition(plus(x, step), u);
      const State back = model.transition(plus(x, -step), u);
      const Error column = minus(forward, back) / (2.0 * kStep);
      // In space the turn of a step enters to second order only.
      EXPECT_LT((column - F.col(i)).norm(), model.planar() ? 1e-6 : 1e-4)
          << "column " << i << " kind " << n % 4;
      const bool listed = (predicted.step.columns >> static_cast<unsigned>(i) & 1U) != 0U ||
                          predicted.step.coupling.col(i).norm() == 0.0;
      EXPECT_TRUE(listed) << "column " << i;
    }
  }
}

TEST_P(ModelOf, ObservationJacobiansAreTheNumericOnes) {
  RandomStream random(3, "model");
  const Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  for (int n = 0; n < 40; ++n) {
    const State x = randomState(random, model.planar());
    std::vector<std::function<Observation(const State&)>> all{
        [&](const State& s) {
          return model.gnssPosition(s, {3, 4, 5}, {1.0, -0.4, 0.3}, R);
        },
        [&](const State& s) {
          return model.gnssVelocity(s, {1, 2, 0.5}, {1.0, -0.4, 0.3}, {0.2, -0.1, 0.7}, true, 0.1);
        },
        [&](const State& s) {
          const double up = std::numeric_limits<double>::quiet_NaN();
          return model.gnssVelocity(s, {1, 2, up}, {1.0, -0.4, 0.3}, {0, 0, 0.7}, false, 0.1);
        },
        [&](const State& s) {
          return model.heading(s, x.yaw() + x.heading_offset + x.disturbance + 0.3, 0.1);
        },
        [&](const State& s) {
          return model.zeroRate(s, {0.01, 0.02, 0.03}, 0.1);
        },
        [&](const State& s) { return model.nonHolonomic(s, 0.4, 0.1, 0.1); },
        [&](const State& s) {
          State without_bias = s;  // which it leaves alone on purpose
          without_bias.gyro_bias.setZero();
          return model.wheelTurn(without_bias, 0.1, 0.08, 0.2, 0.1, 0.01);
        }};
    if (model.planar()) {
      all.emplace_back([&](const State& s) {
        return model.pose(s, {Pose2(1, 2, wrapToPi(x.yaw() - 0.4)), Eigen::Matrix3d::Identity()});
      });
    } else {
      all.emplace_back([&](const State& s) { return model.tilt(s, 0.1, -0.05, 0.02); });
      all.emplace_back([&](const State& s) {
        return model.gravity(s, {0.3, 0.1, 9.7}, {0.2, 0.1, 0}, 0.5);
      });
    }
    for (std::size_t k = 0; k < all.size(); ++k) {
      const Observation z = all[k](x);
      EXPECT_LT((numericJacobian(model, x, all[k]) - z.H.topRows(z.rows)).norm(), 1e-6)
          << "observation " << k;
      for (int i = 0; i < kStateSize; ++i) {
        if ((z.columns >> static_cast<unsigned>(i) & 1U) == 0U) {
          EXPECT_EQ(z.H.col(i).norm(), 0.0) << "observation " << k << " column " << i;
        }
      }
    }
  }
}

TEST_P(ModelOf, ProcessNoiseIsPositiveSemidefinite) {
  RandomStream random(4, "model");
  for (int n = 0; n < 40; ++n) {
    const StateMatrix Q =
        model.predict(randomState(random, model.planar()), randomMotion(random, model.planar(), n))
            .step.Q();
    EXPECT_LT((Q - Q.transpose()).norm(), 1e-15);
    EXPECT_GE(Eigen::SelfAdjointEigenSolver<StateMatrix>(Q).eigenvalues().minCoeff(), -1e-15);
  }
}

INSTANTIATE_TEST_SUITE_P(
    PlaneAndSpace, ModelOf, testing::Values(true, false), [](const auto& each) {
      return each.param ? "plane" : "space";
    });

TEST(Model, ALevelRobotsShorterStepIsTheSame) {
  const Model model(true);
  RandomStream random(8, "level");
  for (int n = 0; n < 200; ++n) {
    const State level = randomState(random, true);
    const Motion u = randomMotion(random, true, n);
    ASSERT_TRUE(u.rolling && level.q.x() == 0.0 && level.q.y() == 0.0);
    // A tilt too small to change a number takes the way of every other robot.
    State other = level;
    other.q.x() = 1e-200;
    const Model::Predicted a = model.predict(level, u);
    const Model::Predicted b = model.predict(other, u);
    EXPECT_LT(minus(a.x, b.x).norm(), 1e-12);
    for (int j = 0; j < kStateSize; ++j) {
      if ((b.step.columns >> static_cast<unsigned>(j) & 1U) == 0U) continue;  // not looked at
      EXPECT_LT((a.step.coupling.col(j) - b.step.coupling.col(j)).norm(), 1e-12) << j;
    }
    EXPECT_LT((a.step.keep - b.step.keep).norm(), 1e-12);
    EXPECT_LT((a.step.top_noise - b.step.top_noise).norm(), 1e-12);
    EXPECT_LT((a.step.rest_noise - b.step.rest_noise).norm(), 1e-12);
    EXPECT_EQ(a.step.columns, b.step.columns);
  }
}

TEST(Model, StaysInThePlane) {
  RandomStream random(5, "model");
  const Model model(true);
  State x = randomState(random, true);
  for (int n = 0; n < 200; ++n) x = model.transition(x, randomMotion(random, true, n));
  EXPECT_EQ(x.p.z(), 0.0);
  EXPECT_EQ(x.q.x(), 0.0);
  EXPECT_EQ(x.q.y(), 0.0);
}

TEST(Model, ResidualsOfAnglesAreWrapped) {
  State x;
  x.q = attitudeOf(3.1, 0, 0);
  EXPECT_NEAR(Model(true).heading(x, -3.1, 0.1).residual[0], 2 * kPi - 6.2, 1e-9);
}

TEST(Model, DrivesAnArcAlongItsChord) {
  Motion u;
  u.dt_s = 1.0;
  u.turn_rad.z() = kPi / 2;
  u.forward_m = std::sqrt(2.0);  // chord of a quarter circle of radius 1
  const State next = Model(true).transition({}, u);
  EXPECT_NEAR(next.p.x(), 1.0, 1e-12);
  EXPECT_NEAR(next.p.y(), 1.0, 1e-12);
  EXPECT_NEAR(next.yaw(), kPi / 2, 1e-12);
}

TEST(Model, SlidesSidewaysAboutItsCentreOfRotation) {
  State x;
  x.icr_x = 0.1;
  Motion u;
  u.dt_s = 1.0;
  u.turn_rad.z() = 1e-3;
  const State next = Model(true).transition(x, u);
  EXPECT_NEAR(next.p.y(), -1e-4, 1e-9);
}

TEST(Model, FallsFreelyWhileItCoasts) {
  State x;
  x.v = {1.0, 0.0, 0.0};
  Motion u;
  u.rolling = false;
  u.dt_s = 0.1;
  const State next = Model(false).transition(x, u);
  EXPECT_NEAR(next.v.z(), -0.981, 1e-12);
  EXPECT_NEAR(next.p.x(), 0.1, 1e-12);
}

TEST(Model, CarriesAWheelOnASlopeUphill) {
  State x;
  x.q = attitudeOf(0.0, -0.1, 0.0);  // nose up
  Motion u;
  u.dt_s = 1.0;
  u.forward_m = 1.0;
  const State next = Model(false).transition(x, u);
  EXPECT_NEAR(next.p.z(), std::sin(0.1), 1e-12);
  EXPECT_NEAR(next.p.x(), std::cos(0.1), 1e-12);
}

}  // namespace
}  // namespace vestibule::ekf
