#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "odometry_core.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/metrics/statistics.hpp"

namespace vestibule::ekf {
namespace {

/// [rad] prior of a heading offset about which nothing is known.
constexpr double kUnknownAngle = 1.0;
/// Samples of a resting gyro are not independent (vibration, quantisation).
constexpr double kZeroRateInflation = 4.0;

}  // namespace

Gate::Gate(const FilterParams& params) {
  for (int dof = 1; dof <= 3; ++dof) {
    limit_[dof - 1] = metrics::chiSquareQuantile(params.gate_probability, dof);
    soft_[dof - 1] = metrics::chiSquareQuantile(params.down_weight_probability, dof);
  }
}

Tracker::Tracker(const FilterParams& params, Pose mode)
    : params_(params), mode_(mode), gate_(params), engine_(makeMrptEngine()) {}

void Tracker::start(
    const PoseWithCovariance& T,
    const Eigen::Vector2d& bias_mean_var,
    const Eigen::Vector2d& scale_mean_var) {
  State x = State::Zero();
  x[kX] = T.mean.x;
  x[kY] = T.mean.y;
  x[kYaw] = wrapToPi(T.mean.phi);
  x[kGyroBias] = bias_mean_var[0];
  x[kWheelScale] = scale_mean_var[0];
  StateMatrix P = StateMatrix::Zero();
  P.topLeftCorner<3, 3>() = T.cov;
  P(kGyroBias, kGyroBias) = bias_mean_var[1];
  P(kWheelScale, kWheelScale) = scale_mean_var[1];
  P(kHeadingOffset, kHeadingOffset) = kUnknownAngle * kUnknownAngle;
  P(kDisturbance, kDisturbance) =
      params_.heading.disturbance_sigma_rad * params_.heading.disturbance_sigma_rad;
  engine_->set(x, P);
  heading_known_ = false;
  heading_rejected_since_.reset();
}

UpdateReport Tracker::offer(Observation z, double inflation) {
  UpdateReport report;
  report.dof = z.dof();
  report.gate = gate_.limit(report.dof);
  const Observation::Noise S = z.H * engine_->covariance() * z.H.transpose() + z.R;
  report.nis = z.residual.dot(S.llt().solve(z.residual));
  if (!(report.nis <= report.gate)) {
    report.decision = Decision::kGated;
    report.reason = "chi2";
    return report;
  }
  const double soft = gate_.soft(report.dof);
  if (report.nis > soft) {
    report.decision = Decision::kDownWeighted;
    report.reason = "chi2";
    inflation *= report.nis / soft;
  }
  z.R *= inflation;
  update(z);
  return report;
}

void Tracker::update(const Observation& z) {
  const State before = engine_->state();
  engine_->update(z);
  if (mode_ == Pose::kCorrected) return;
  State x = engine_->state();
  x.head<2>() = before.head<2>();
  // Learning the bias would turn the robot by all that the wrong bias turned it so far.
  if (z.H(0, kYaw) == 0.0) x[kYaw] = before[kYaw];
  engine_->set(x, engine_->covariance());
}

UpdateReport Tracker::offerHeading(const Heading& heading) {
  const double sigma = std::max(heading.sigma_rad.value_or(0.0), params_.heading.sigma_rad);
  if (!heading_known_) {
    const double difference = angleDiff(heading.yaw_rad, state()[kYaw]);
    const double usual = std::hypot(
        params_.heading.offset_sigma_rad,
        std::hypot(params_.heading.disturbance_sigma_rad, std::sqrt(covariance()(kYaw, kYaw))));
    if (mode_ == Pose::kCorrected && std::abs(difference) < 2.0 * usual) {
      learnHeadingOffset(0.0, params_.heading.offset_sigma_rad);
    } else {
      learnHeadingOffset(difference, kUnknownAngle);
    }
    heading_known_ = true;
    UpdateReport report = offer(PlanarModel::heading(state(), heading.yaw_rad, sigma));
    report.reason = "initialised";
    return report;
  }
  UpdateReport report = offer(PlanarModel::heading(state(), heading.yaw_rad, sigma));
  if (report.decision != Decision::kGated) {
    heading_rejected_since_.reset();
    return report;
  }
  if (!heading_rejected_since_) heading_rejected_since_ = heading.stamp;
  if (toSeconds(heading.stamp - *heading_rejected_since_) > params_.heading.relearn_after_s) {
    // The sensor keeps saying so: whatever turned it, it can be used again from here on.
    learnHeadingOffset(angleDiff(heading.yaw_rad, state()[kYaw]), kUnknownAngle);
    heading_rejected_since_.reset();
    (void)offer(PlanarModel::heading(state(), heading.yaw_rad, sigma));
    report.reason = "relearn";
  }
  return report;
}

void Tracker::learnHeadingOffset(double mean_rad, double sigma_rad) {
  State x = engine_->state();
  StateMatrix P = engine_->covariance();
  x[kDisturbance] = 0.0;
  x[kHeadingOffset] = mean_rad;
  for (const int i : {static_cast<int>(kHeadingOffset), static_cast<int>(kDisturbance)}) {
    P.row(i).setZero();
    P.col(i).setZero();
  }
  P(kHeadingOffset, kHeadingOffset) = sigma_rad * sigma_rad;
  P(kDisturbance, kDisturbance) =
      params_.heading.disturbance_sigma_rad * params_.heading.disturbance_sigma_rad;
  engine_->set(x, P);
}

void Tracker::zeroRate(double omega_radps, double interval_s) {
  const double sigma = params_.gyro.noise_rad_sqrt_s / std::sqrt(std::max(interval_s, 1e-3));
  (void)offer(PlanarModel::zeroRate(state(), omega_radps, sigma), kZeroRateInflation);
}

void Tracker::resetPosition(const Eigen::Vector2d& p, const Eigen::Matrix2d& cov) {
  State x = engine_->state();
  StateMatrix P = engine_->covariance();
  x.head<2>() = p;
  P.topRows<2>().setZero();
  P.leftCols<2>().setZero();
  P.topLeftCorner<2, 2>() = cov;
  engine_->set(x, P);
}

PoseWithCovariance Tracker::pose() const {
  const State x = engine_->state();
  return {Pose2(x[kX], x[kY], x[kYaw]), engine_->covariance().topLeftCorner<3, 3>()};
}

Eigen::Vector2d Tracker::marginal(int index) const {
  return {engine_->state()[index], engine_->covariance()(index, index)};
}

Pose2 carriedOn(const DeadReckoning& reckoning, const State& state, Timestamp stamp) {
  const Timestamp limit = reckoning.time() + std::chrono::milliseconds(500);
  const Timestamp until = std::clamp(stamp, reckoning.time(), limit);
  const State x = PlanarModel::transition(state, reckoning.ahead(until));
  return {x[kX], x[kY], x[kYaw]};
}

OdometryFilter::Core::Core(const FilterParams& p)
    : params(p), reckoning(p), tracker(p, Tracker::Pose::kContinuous) {
  tracker.start(
      {},
      {0.0, p.gyro.bias_sigma_radps * p.gyro.bias_sigma_radps},
      {0.0, p.wheels.scale_sigma * p.wheels.scale_sigma});
}

std::optional<Motion> OdometryFilter::Core::process(const WheelOdometry& wheels) {
  if (!isFinite(wheels.T_previous_now) || !(wheels.dt_s >= 0.0) || !std::isfinite(wheels.dt_s)) {
    ++dropped.not_finite;
    return std::nullopt;
  }
  if (reckoning.stale(wheels.stamp)) {
    ++dropped.stale;
    return std::nullopt;
  }
  const Motion u = reckoning.process(wheels);
  tracker.step(u);
  return u;
}

std::optional<Motion> OdometryFilter::Core::process(const Imu& imu) {
  zero_rate_interval_s_.reset();
  if (!imu.omega_radps.allFinite()) {
    ++dropped.not_finite;
    return std::nullopt;
  }
  if (reckoning.stale(imu.stamp)) {
    ++dropped.stale;
    return std::nullopt;
  }
  const Motion u = reckoning.process(imu, tracker.state()[kGyroBias]);
  tracker.step(u);
  if (reckoning.standstill() && last_imu_) {
    const double interval_s = toSeconds(imu.stamp - *last_imu_);
    zero_rate_interval_s_ = interval_s;
    tracker.zeroRate(reckoning.rate(), interval_s);
  }
  last_imu_ = imu.stamp;
  return u;
}

std::optional<Motion> OdometryFilter::Core::advance(Timestamp stamp) {
  if (reckoning.stale(stamp)) {
    ++dropped.stale;
    return std::nullopt;
  }
  const Motion u = reckoning.advance(stamp);
  tracker.step(u);
  return u;
}

OdometryFilter::OdometryFilter(const FilterParams& params)
    : core_(std::make_unique<Core>(params)) {}
OdometryFilter::OdometryFilter(OdometryFilter&&) noexcept = default;
OdometryFilter& OdometryFilter::operator=(OdometryFilter&&) noexcept = default;
OdometryFilter::~OdometryFilter() = default;

void OdometryFilter::process(const WheelOdometry& wheels) { (void)core_->process(wheels); }
void OdometryFilter::process(const Imu& imu) { (void)core_->process(imu); }

void OdometryFilter::process(const Heading& heading) {
  if (!std::isfinite(heading.yaw_rad) || !std::isfinite(heading.sigma_rad.value_or(0.0))) {
    ++core_->dropped.not_finite;
    return;
  }
  if (core_->advance(heading.stamp)) core_->update(heading);
}

PoseWithCovariance OdometryFilter::pose() const { return core_->tracker.pose(); }
Pose2 OdometryFilter::poseAt(Timestamp stamp) const {
  return carriedOn(core_->reckoning, core_->tracker.state(), stamp);
}
Timestamp OdometryFilter::time() const { return core_->reckoning.time(); }
double OdometryFilter::yawRate() const {
  if (standstill()) return 0.0;
  return core_->reckoning.rate() - (core_->reckoning.rateIsGyro() ? gyroBias() : 0.0);
}
double OdometryFilter::speed() const { return core_->reckoning.speed(); }
bool OdometryFilter::standstill() const { return core_->reckoning.standstill(); }
double OdometryFilter::gyroBias() const { return core_->tracker.state()[kGyroBias]; }
const Dropped& OdometryFilter::dropped() const { return core_->dropped; }

}  // namespace vestibule::ekf
