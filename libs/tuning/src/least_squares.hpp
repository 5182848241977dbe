#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

namespace vestibule::tuning {

/// A fit with its covariance. Every parameter has a weak prior about its start, so that a direction
/// the data do not see keeps the prior's width instead of making the equations singular.
struct Fit {
  Eigen::VectorXd parameters;
  Eigen::MatrixXd cov;
  int iterations = 0;
};

/// Levenberg-Marquardt with numeric derivatives and Huber's weights.
///
/// \param residuals    whitened: of unit size where the model is right
/// \param prior_sigma  of each parameter about its start
/// \param groups       group of each residual, for the covariance: residuals of one group may be
///                     correlated in any way, those of different groups are taken for independent
///                     (the "sandwich" of Liang and Zeger 1986). It never gets smaller by it.
///                     Empty: every residual is independent
[[nodiscard]] Fit leastSquares(
    const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& residuals,
    const Eigen::VectorXd& start,
    const Eigen::VectorXd& prior_sigma,
    const std::vector<int>& groups = {});

/// Errors of a drive are taken for independent from one such stretch to the next.
inline constexpr double kStretch_s = 20.0;
/// The group of a residual at a time since the start. \param stretch_s of one group
[[nodiscard]] inline int groupAt(double at_s, double stretch_s = kStretch_s) {
  return static_cast<int>(at_s / stretch_s);
}

/// Least squares whose noise is the scatter about the fit, known after the first round.
/// \param groups  of the misfits, as for leastSquares()
/// \pre misfits() is never empty
[[nodiscard]] Fit robustFit(
    const std::function<std::vector<double>(const Eigen::VectorXd&)>& misfits,
    const Eigen::VectorXd& start,
    const Eigen::VectorXd& prior_sigma,
    const std::vector<int>& groups);

}  // namespace vestibule::tuning
