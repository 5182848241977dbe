#include "least_squares.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>

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

/// Of every parameter: standard deviation by the scatter of the groups over that of independent
/// residuals, at least 1.
Eigen::VectorXd inflations(
    const Eigen::MatrixXd& J,
    const Eigen::VectorXd& weighted,
    const Eigen::VectorXd& prior,
    const Eigen::MatrixXd& cov,
    const std::vector<int>& groups) {
  std::map<int, Eigen::VectorXd> gradients;
  for (Eigen::Index i = 0; i < J.rows(); ++i) {
    auto& g = gradients[groups[static_cast<std::size_t>(i)]];
    if (g.size() == 0) g = Eigen::VectorXd::Zero(J.cols());
    g += weighted[i] * J.row(i).transpose();
  }
  const auto m = static_cast<double>(gradients.size());
  const auto n = static_cast<double>(J.cols());
  if (m < n + 1.0) return Eigen::VectorXd::Ones(J.cols());
  Eigen::MatrixXd B = prior.asDiagonal();
  for (const auto& entry : gradients) {
    B += m / (m - n) * entry.second * entry.second.transpose();
  }
  const Eigen::MatrixXd sandwich = cov * B * cov;
  return (sandwich.diagonal().array() / cov.diagonal().array()).max(1.0).sqrt();
}

double medianSize(std::vector<double> r) {
  for (double& x : r) x = std::abs(x);
  const auto middle = r.begin() + static_cast<std::ptrdiff_t>(r.size() / 2);
  std::nth_element(r.begin(), middle, r.end());
  return *middle;
}

/// Sizes of misfits by group: those of all, or those of its own group where that is worse (fixes
/// without corrections, wheels that slip).
std::vector<double> sizesOf(const std::vector<double>& misfits, const std::vector<int>& groups) {
  std::map<int, std::vector<double>> of_group;
  for (std::size_t i = 0; i < misfits.size(); ++i) of_group[groups[i]].push_back(misfits[i]);
  std::map<int, double> size;
  const double all = std::max(1e-4, 1.4826 * medianSize(misfits));
  for (const auto& [group, of] : of_group) size[group] = std::max(all, 1.4826 * medianSize(of));
  std::vector<double> sizes;
  for (const int group : groups) sizes.push_back(size[group]);
  return sizes;
}

}  // namespace

Fit leastSquares(
    const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& residuals,
    const Eigen::VectorXd& start,
    const Eigen::VectorXd& prior_sigma,
    const std::vector<int>& groups) {
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
  Eigen::MatrixXd J(r.size(), n);
  for (fit.iterations = 0; fit.iterations < kMostIterations; ++fit.iterations) {
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
  if (groups.empty()) return fit;
  const Eigen::VectorXd weighted = huberWeights(r).cwiseProduct(r);
  const Eigen::VectorXd factor = inflations(J, weighted, prior, fit.cov, groups);
  fit.cov = factor.asDiagonal() * fit.cov * factor.asDiagonal();
  return fit;
}

Fit robustFit(
    const std::function<std::vector<double>(const Eigen::VectorXd&)>& misfits,
    const Eigen::VectorXd& start,
    const Eigen::VectorXd& prior_sigma,
    const std::vector<int>& groups) {
  Fit fit;
  std::vector<double> sizes = sizesOf(misfits(start), groups);
  for (int round = 0; round < 4; ++round) {
    const auto residuals = [&](const Eigen::VectorXd& p) {
      const std::vector<double> r = misfits(p);
      Eigen::VectorXd white(static_cast<Eigen::Index>(r.size()));
      for (std::size_t i = 0; i < r.size(); ++i)
        white[static_cast<Eigen::Index>(i)] = r[i] / sizes[i];
      return white;
    };
    fit = leastSquares(residuals, start, prior_sigma, groups);
    sizes = sizesOf(misfits(fit.parameters), groups);
  }
  return fit;
}

}  // namespace vestibule::tuning
