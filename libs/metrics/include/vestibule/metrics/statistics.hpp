#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "vestibule/core/frames.hpp"

namespace vestibule::metrics {

/// Figures of a set of error magnitudes. All zero when count is zero.
struct Statistics {
  std::size_t count = 0;
  double rmse = 0.0;
  double mean = 0.0;
  double stddev = 0.0;  ///< of the population (divides by count)
  double median = 0.0;
  double p95 = 0.0;  ///< linear interpolation between order statistics
  double max = 0.0;
};

/// \pre all values finite
[[nodiscard]] Statistics statistics(std::vector<double> values);

/// P(X <= x) for a chi-square variable. \pre dof >= 1
[[nodiscard]] double chiSquareProbability(double x, int dof);
/// The x with chiSquareProbability(x, dof) = p. \pre 0 < p < 1, dof >= 1
[[nodiscard]] double chiSquareQuantile(double p, int dof);

/// Normalised estimation error squared of x, y and yaw (3 degrees of freedom): e' P^-1 e.
/// Empty when the covariance is not positive definite or something is not finite.
[[nodiscard]] std::optional<double> nees(const PoseWithCovariance& estimate, const Pose2& truth);

}  // namespace vestibule::metrics
