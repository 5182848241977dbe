#include "vestibule/metrics/statistics.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule::metrics {
namespace {

/// \pre sorted, not empty
double quantile(const std::vector<double>& sorted, double p) {
  const double position = p * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  const double s = position - static_cast<double>(below);
  return sorted[below] + s * (sorted[above] - sorted[below]);
}

}  // namespace

Statistics statistics(std::vector<double> values) {
  Statistics result;
  result.count = values.size();
  if (values.empty()) return result;
  const auto n = static_cast<double>(values.size());
  double sum = 0.0;
  double sum_of_squares = 0.0;
  for (const double v : values) {
    sum += v;
    sum_of_squares += v * v;
  }
  result.mean = sum / n;
  result.rmse = std::sqrt(sum_of_squares / n);
  double spread = 0.0;
  for (const double v : values) spread += (v - result.mean) * (v - result.mean);
  result.stddev = std::sqrt(spread / n);
  std::sort(values.begin(), values.end());
  result.median = quantile(values, 0.5);
  result.p95 = quantile(values, 0.95);
  result.max = values.back();
  return result;
}

double chiSquareProbability(double x, int dof) {
  if (!(x > 0.0)) return 0.0;
  // F_1 and F_2 are elementary; F_{k+2} = F_k - (x/2)^{k/2} e^{-x/2} / Gamma(k/2 + 1).
  const double half = 0.5 * x;
  const bool odd = dof % 2 == 1;
  double probability = odd ? std::erf(std::sqrt(half)) : 1.0 - std::exp(-half);
  for (int k = odd ? 1 : 2; k < dof; k += 2) {
    const double a = 0.5 * static_cast<double>(k);
    probability -= std::exp(a * std::log(half) - half - std::lgamma(a + 1.0));
  }
  return probability;
}

double chiSquareQuantile(double p, int dof) {
  double low = 0.0;
  double high = std::max(1.0, static_cast<double>(dof));
  while (chiSquareProbability(high, dof) < p && high < 1e6) high *= 2.0;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (chiSquareProbability(middle, dof) < p ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

std::optional<double> nees(const PoseWithCovariance& estimate, const Pose2& truth) {
  const Eigen::Vector3d error(
      estimate.mean.x - truth.x,
      estimate.mean.y - truth.y,
      angleDiff(estimate.mean.phi, truth.phi));
  if (!error.allFinite() || !estimate.cov.allFinite()) return std::nullopt;
  const Eigen::LLT<Eigen::Matrix3d> cholesky(estimate.cov);
  if (cholesky.info() != Eigen::Success) return std::nullopt;
  return error.dot(cholesky.solve(error));
}

}  // namespace vestibule::metrics
