#include "gnss_screen.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "vestibule/ekf/claims.hpp"

namespace vestibule::ekf {
namespace {

constexpr double kDoubtFactor = 3.0;  ///< of sigma after an outage
constexpr double kDoubt_s = 5.0;
constexpr int kFewSatellites = 5;
constexpr double kFewSatellitesFactor = 2.0;
constexpr double kClusterSigmas = 1.0;  ///< rms spread of a cluster about its mean
constexpr double kVertical = 1.5;       ///< heights are so much worse than positions, at least
constexpr double kSpeedSlack = 6.0;     ///< sigmas by which two fixes may differ at one place
constexpr double kMostVariance = 1e8;   ///< [m^2] a receiver that claims more says nothing
constexpr double kSpacing_s = 1.0;      ///< nearer fixes replace each other
constexpr std::size_t kMaxCandidates = 200;

FixKind kindOf(GnssFixType type) {
  switch (type) {
    case GnssFixType::kRtkFixed:
    case GnssFixType::kRtkFloat:
      return FixKind::kCarrierPhase;
    case GnssFixType::kDifferential:
      return FixKind::kDifferential;
    default:
      return FixKind::kCode;
  }
}

}  // namespace

GnssErrorModel errorModel(FixKind kind, const GnssParams& p) {
  // Where no slow error is estimated, all fixes within its time count as one.
  switch (kind) {
    case FixKind::kCode:
      return {p.slow_share, p.correlation_s, p.slow_share > 0.0 ? p.repeat_s : p.correlation_s};
    case FixKind::kDifferential:
      return {
          p.differential_slow_share,
          p.differential_correlation_s,
          p.differential_slow_share > 0.0 ? p.differential_repeat_s : p.differential_correlation_s};
    case FixKind::kCarrierPhase:
      break;
  }
  return {
      p.rtk_slow_share, p.rtk_correlation_s, p.rtk_slow_share > 0.0 ? 0.0 : p.rtk_correlation_s};
}

GnssScreen::Worth GnssScreen::assess(const MapFix& fix) {
  const GnssParams& gnss = params_->gnss;
  Worth worth;
  if (fix.type == GnssFixType::kNone) {
    worth.refused = "no fix";
    return worth;
  }
  worth.kind = kindOf(fix.type);
  double least = leastSigma(fix.type, gnss);
  // A dilution of precision scales code errors, both axes together; carrier-phase fixes carry their
  // own floor.
  if (fix.hdop && std::isfinite(*fix.hdop) && worth.kind != FixKind::kCarrierPhase) {
    least = std::max(least, *fix.hdop * gnss.uere_m / std::sqrt(2.0));
  }
  double doubt = 1.0;
  if (fix.satellites && *fix.satellites < kFewSatellites) doubt = kFewSatellitesFactor;
  if (last_fix_ && toSeconds(fix.stamp - *last_fix_) > gnss.gap_s) {
    doubtful_until_ = fix.stamp + durationFromSeconds(kDoubt_s);
  }
  last_fix_ = fix.stamp;
  if (doubtful_until_ && fix.stamp < *doubtful_until_) doubt = std::max(doubt, kDoubtFactor);

  Eigen::Matrix2d reported = Eigen::Matrix2d::Zero();
  double reported_up = 0.0;
  if (fix.cov && fix.cov->allFinite() && fix.cov->cwiseAbs().maxCoeff() < kMostVariance) {
    reported = 0.5 * (fix.cov->topLeftCorner<2, 2>() + fix.cov->topLeftCorner<2, 2>().transpose());
    reported_up = (*fix.cov)(2, 2);
  } else if (fix.cov && fix.cov->allFinite()) {
    reported = kMostVariance * Eigen::Matrix2d::Identity();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(reported);
  const Eigen::Vector2d variances = axes.eigenvalues().cwiseMax(least * least);
  worth.sigma_m = std::sqrt(variances.maxCoeff());
  if (!(worth.sigma_m <= gnss.max_sigma_m)) {
    worth.refused = "sigma";
    return worth;
  }
  const Eigen::Matrix2d R = doubt * doubt * axes.eigenvectors() * variances.asDiagonal() *
                            axes.eigenvectors().transpose();
  worth.R.topLeftCorner<2, 2>() = 0.5 * (R + R.transpose());
  if (last_used_) {
    const double interval_s = std::max(1e-3, toSeconds(fix.stamp - *last_used_));
    worth.repeats = std::max(1.0, 2.0 * errorModel(worth.kind, gnss).repeat_s / interval_s);
  }
  const double least_up = kVertical * kVertical * worth.sigma_m * worth.sigma_m;
  worth.R(2, 2) = doubt * doubt * std::max(reported_up, least_up);
  return worth;
}

bool GnssScreen::tooFast(const MapFix& fix, double sigma_m) const {
  if (!last_used_) return false;
  const double dt_s = toSeconds(fix.stamp - *last_used_);
  const double moved_m = (fix.p_map_antenna.head<2>() - last_used_at_).norm();
  return moved_m > params_->gnss.max_speed_mps * dt_s + kSpeedSlack * sigma_m;
}

void GnssScreen::accepted(const MapFix& fix) {
  last_used_ = fix.stamp;
  last_used_at_ = fix.p_map_antenna.head<2>();
  candidates_.clear();
}

std::optional<GnssScreen::Cluster> GnssScreen::refused(
    const MapFix& fix, double sigma_m, const Pose2& T_odom_base, double yaw_map_base) {
  const Candidate candidate{fix.stamp, fix.p_map_antenna.head<2>(), T_odom_base, sigma_m};
  const std::size_t count = candidates_.size();
  if (count >= 2 && toSeconds(fix.stamp - candidates_[count - 2].stamp) < kSpacing_s) {
    candidates_.back() = candidate;
  } else {
    candidates_.push_back(candidate);
  }
  if (candidates_.size() > kMaxCandidates) candidates_.pop_front();
  const auto enough = static_cast<std::size_t>(params_->recovery.min_fixes);
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
  if (toSeconds(fix.stamp - candidates_.front().stamp) < params_->recovery.min_span_s ||
      travel_m < params_->recovery.travel(sigma_m)) {
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
