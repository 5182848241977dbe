#include "gnss_screen.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace vestibule::ekf {
namespace {

constexpr double kDoubtFactor = 3.0;  ///< of sigma after an outage
constexpr double kDoubt_s = 5.0;
constexpr int kFewSatellites = 5;
constexpr double kFewSatellitesFactor = 2.0;
constexpr double kClusterSigmas = 1.0;  ///< rms spread of a cluster about its mean

bool isRtk(GnssFixType type) {
  return type == GnssFixType::kRtkFixed || type == GnssFixType::kRtkFloat;
}

double floorOf(GnssFixType type, const GnssParams& p) {
  switch (type) {
    case GnssFixType::kRtkFixed:
      return p.sigma_rtk_fixed_m;
    case GnssFixType::kRtkFloat:
      return p.sigma_rtk_float_m;
    case GnssFixType::kDifferential:
      return p.sigma_differential_m;
    case GnssFixType::kSingle:
    case GnssFixType::kUnknown:
    case GnssFixType::kNone:
      break;
  }
  return p.sigma_single_m;
}

}  // namespace

GnssScreen::Worth GnssScreen::assess(
    Timestamp stamp,
    const std::optional<Eigen::Matrix2d>& cov,
    GnssFixType type,
    std::optional<double> hdop,
    std::optional<int> satellites) {
  Worth worth;
  if (type == GnssFixType::kNone) {
    worth.refused = "no fix";
    return worth;
  }
  double least = floorOf(type, params_.gnss);
  // A dilution of precision scales code errors; carrier-phase fixes carry their own floor.
  if (hdop && std::isfinite(*hdop) && !isRtk(type)) {
    least = std::max(least, *hdop * params_.gnss.uere_m);
  }
  double factor = 1.0;
  if (satellites && *satellites < kFewSatellites) factor = kFewSatellitesFactor;
  if (last_fix_ && toSeconds(stamp - *last_fix_) > params_.gnss.gap_s) {
    doubtful_until_ = stamp + durationFromSeconds(kDoubt_s);
  }
  last_fix_ = stamp;
  if (doubtful_until_ && stamp < *doubtful_until_) factor = std::max(factor, kDoubtFactor);

  Eigen::Matrix2d reported = Eigen::Matrix2d::Zero();
  if (cov && cov->allFinite()) reported = 0.5 * (*cov + cov->transpose());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(reported);
  const Eigen::Vector2d variances = axes.eigenvalues().cwiseMax(least * least) * (factor * factor);
  worth.R = axes.eigenvectors() * variances.asDiagonal() * axes.eigenvectors().transpose();
  worth.sigma_m = std::sqrt(variances.maxCoeff());
  if (worth.sigma_m > params_.gnss.max_sigma_m * factor) worth.refused = "sigma";

  const double correlation_s =
      isRtk(type) ? params_.gnss.rtk_correlation_s : params_.gnss.correlation_s;
  const double interval_s =
      last_used_ ? std::max(1e-3, toSeconds(stamp - *last_used_)) : 2.0 * correlation_s;
  worth.inflation = std::max(1.0, 2.0 * correlation_s / interval_s);
  return worth;
}

void GnssScreen::accepted(Timestamp stamp) {
  last_used_ = stamp;
  candidates_.clear();
}

std::optional<GnssScreen::Cluster> GnssScreen::refused(
    Timestamp stamp,
    const Eigen::Vector2d& p_map_antenna,
    double sigma_m,
    const Pose2& T_odom_base,
    double yaw_map_base) {
  candidates_.push_back({stamp, p_map_antenna, T_odom_base, sigma_m});
  const auto enough = static_cast<std::size_t>(params_.recovery.min_fixes);
  // Where each fix, carried on by the odometry since then, puts the base now.
  std::vector<Eigen::Vector2d> now;
  for (const Candidate& c : candidates_) {
    const Pose2 T_now_then = between(T_odom_base, c.T_odom_base);
    const Point2 antenna = transform(T_now_then, p_base_antenna_);
    const Point2 lever = transform(Pose2(0, 0, yaw_map_base), antenna);
    now.emplace_back(c.p_map_antenna - Eigen::Vector2d(lever.x, lever.y));
  }
  // The longest run of the newest fixes that agree.
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double sum_sq = 0.0;
  std::size_t agreeing = 0;
  double sigma_sq_sum = 0.0;
  const Eigen::Vector2d reference = now.back();
  for (std::size_t k = now.size(); k-- > 0;) {
    const Eigen::Vector2d d = now[k] - reference;
    const double n = static_cast<double>(now.size() - k);
    const double next_sigma_sq = sigma_sq_sum + candidates_[k].sigma_m * candidates_[k].sigma_m;
    const double spread = (sum_sq + d.squaredNorm()) / n - ((sum + d) / n).squaredNorm();
    if (spread > 2.0 * kClusterSigmas * kClusterSigmas * next_sigma_sq / n) break;
    sum += d;
    sum_sq += d.squaredNorm();
    sigma_sq_sum = next_sigma_sq;
    ++agreeing;
  }
  candidates_.erase(candidates_.begin(), candidates_.end() - static_cast<std::ptrdiff_t>(agreeing));
  if (agreeing < enough) return std::nullopt;
  double travel_m = 0.0;
  for (const Candidate& c : candidates_) {
    travel_m = std::max(travel_m, distance(c.T_odom_base, T_odom_base));
  }
  if (toSeconds(stamp - candidates_.front().stamp) < params_.recovery.min_span_s ||
      travel_m < params_.recovery.min_travel_m) {
    return std::nullopt;
  }
  const auto n = static_cast<double>(agreeing);
  return Cluster{reference + sum / n, Eigen::Matrix2d::Identity() * (sigma_sq_sum / n)};
}

void GnssScreen::forget() {
  candidates_.clear();
  last_used_.reset();
}

}  // namespace vestibule::ekf
