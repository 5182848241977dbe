#include "least_squares.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace vestibule::tuning {
namespace {

constexpr double kHuber = 1.5;        // residuals beyond it count linearly
constexpr double kDerivative = 1e-4;  // of the prior's sigma
constexpr int kMostIterations = 50;

Eigen::VectorXd huberWeights(const Eigen::VectorXd& r) {
  return r.unaryExpr([](double x) { return std::abs(x) > kHuber ? kHuber / std::abs(x) : 1.0; });
}

double huberCost(const Eigen::VectorXd& r) {
  double sum = 0.0;
  for (const double x : r) {
    const double a = std::abs(x);
    sum += a > kHuber ? kHuber * (a - 0.5 * kHuber) : 0.5 * a * a;
  }
  return sum;
}

}  // namespace

Fit leastSquares(
    const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& residuals,
    const Eigen::VectorXd& start,
    const Eigen::VectorXd& prior_sigma) {
  const auto n = start.size();
  const Eigen::VectorXd prior = prior_sigma.array().square().inverse();
  const auto cost = [&](const Eigen::VectorXd& p, const Eigen::VectorXd& r) {
    return huberCost(r) + 0.5 * (prior.array() * (p - start).array().square()).sum();
  };
  Fit fit;
  fit.parameters = start;
  double damping = 1e-3;
  Eigen::VectorXd r = residuals(start);
  Eigen::MatrixXd A(n, n);
  for (fit.iterations = 0; fit.iterations < kMostIterations; ++fit.iterations) {
    Eigen::MatrixXd J(r.size(), n);
    for (Eigen::Index k = 0; k < n; ++k) {
      Eigen::VectorXd p = fit.parameters;
      const double h = kDerivative * prior_sigma[k];
      p[k] += h;
      const Eigen::VectorXd above = residuals(p);
      p[k] -= 2.0 * h;
      J.col(k) = (above - residuals(p)) / (2.0 * h);
    }
    const Eigen::VectorXd w = huberWeights(r);
    A = J.transpose() * w.asDiagonal() * J;
    A.diagonal() += prior;
    const Eigen::VectorXd gradient =
        J.transpose() * (w.asDiagonal() * r) +
        Eigen::VectorXd(prior.array() * (fit.parameters - start).array());
    bool moved = false;
    while (damping < 1e8) {
      Eigen::MatrixXd damped = A;
      damped.diagonal() *= 1.0 + damping;
      const Eigen::VectorXd step = damped.ldlt().solve(-gradient);
      const Eigen::VectorXd p = fit.parameters + step;
      const Eigen::VectorXd there = residuals(p);
      if (there.allFinite() && cost(p, there) < cost(fit.parameters, r)) {
        moved = (step.array().abs() > 1e-6 * prior_sigma.array()).any();
        fit.parameters = p;
        r = there;
        damping = std::max(1e-9, 0.2 * damping);
        break;
      }
      damping *= 5.0;
    }
    if (!moved) break;
  }
  fit.cov = A.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  return fit;
}

}  // namespace vestibule::tuning
