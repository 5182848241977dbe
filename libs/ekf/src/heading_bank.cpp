#include "heading_bank.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/metrics/statistics.hpp"

namespace vestibule::ekf {
namespace {

constexpr int kHypotheses = 8;
/// [rad] of each at first: neighbours overlap.
constexpr double kStartSigma = 0.5;
/// [rad] what the odometry bends between two velocities.
constexpr double kBend = 0.005;
/// [rad] known no better, however many velocities agree: wheels slide sideways.
constexpr double kLeastSigma = 0.03;
/// Slower robots tell no direction [sigma].
constexpr double kLeastSpeed = 3.0;
/// A bank whose best hypothesis found what came less likely than this does not fit at all.
constexpr double kFitProbability = 0.999;

}  // namespace

HeadingBank::HeadingBank(const FilterParams& params) : params_(&params) {
  for (int i = 0; i < kHypotheses; ++i) {
    Hypothesis h;
    h.yaw_rad = wrapToPi(2.0 * kPi * i / kHypotheses);
    h.P.diagonal() << kStartSigma * kStartSigma,
        params.wheels.scale_sigma * params.wheels.scale_sigma;
    bank_.push_back(h);
  }
}

void HeadingBank::add(
    const Eigen::Vector2d& v_map_antenna, const Eigen::Vector2d& v_odom_antenna, double sigma_mps) {
  if (v_odom_antenna.norm() < kLeastSpeed * sigma_mps) return;
  ++count_;
  double best = -1e300;
  for (Hypothesis& h : bank_) {
    h.P(0, 0) += kBend * kBend;
    const double c = std::exp(h.log_scale) * std::cos(h.yaw_rad);
    const double s = std::exp(h.log_scale) * std::sin(h.yaw_rad);
    const Eigen::Vector2d expected(
        c * v_odom_antenna.x() - s * v_odom_antenna.y(),
        s * v_odom_antenna.x() + c * v_odom_antenna.y());
    Eigen::Matrix2d H;
    H << -expected.y(), expected.x(), expected.x(), expected.y();
    const Eigen::Vector2d residual = v_map_antenna - expected;
    const Eigen::Matrix2d S =
        H * h.P * H.transpose() + sigma_mps * sigma_mps * Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d S_inverse = S.inverse();
    const Eigen::Matrix2d K = h.P * H.transpose() * S_inverse;
    const Eigen::Vector2d correction = K * residual;
    h.yaw_rad = wrapToPi(h.yaw_rad + correction[0]);
    h.log_scale = std::clamp(h.log_scale + correction[1], -0.5, 0.5);
    const Eigen::Matrix2d A = Eigen::Matrix2d::Identity() - K * H;
    h.P = (A * h.P * A.transpose() + sigma_mps * sigma_mps * K * K.transpose()).eval();
    const double nis = residual.dot(S_inverse * residual);
    h.nis_sum += nis;
    h.log_weight -= 0.5 * (nis + std::log(S.determinant()));
    best = std::max(best, h.log_weight);
  }
  for (Hypothesis& h : bank_) h.log_weight -= best;
}

std::optional<HeadingBank::Result> HeadingBank::solve() const {
  if (count_ < params_->init.min_fixes) return std::nullopt;
  double sum = 0.0;
  double sine = 0.0;
  double cosine = 0.0;
  double nis_sum = 0.0;
  for (const Hypothesis& h : bank_) {
    const double weight = std::exp(h.log_weight);
    sum += weight;
    sine += weight * std::sin(h.yaw_rad);
    cosine += weight * std::cos(h.yaw_rad);
    if (h.log_weight == 0.0) nis_sum = h.nis_sum;
  }
  if (nis_sum > metrics::chiSquareQuantile(kFitProbability, 2 * count_)) return std::nullopt;
  Result result;
  result.yaw_map_odom_rad = std::atan2(sine, cosine);
  double variance = kLeastSigma * kLeastSigma;
  for (const Hypothesis& h : bank_) {
    const double off = angleDiff(h.yaw_rad, result.yaw_map_odom_rad);
    variance += std::exp(h.log_weight) / sum * (h.P(0, 0) + off * off);
  }
  result.sigma_rad = std::sqrt(variance);
  if (result.sigma_rad > params_->init.max_yaw_sigma_rad) return std::nullopt;
  return result;
}

}  // namespace vestibule::ekf
