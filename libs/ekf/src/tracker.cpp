#include "tracker.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "vestibule/core/angles.hpp"
#include "vestibule/metrics/statistics.hpp"

namespace vestibule::ekf {
namespace {

/// [rad] prior of a heading offset about which nothing is known.
constexpr double kUnknownAngle = 1.0;
/// [rad] prior of roll and pitch.
constexpr double kUnknownTilt = 0.3;
/// Samples of a resting gyro are not independent (vibration, quantisation).
constexpr double kZeroRateInflation = 4.0;
/// The same of an accelerometer used as a level many times a second.
constexpr double kLevelInflation = 10.0;
/// Sideways speed of a robot that coasts [m/s].
constexpr double kCoastSide_mps = 0.1;

/// Beyond these nothing is known any more, and nothing more can be unknown: variances.
Error mostUncertain() {
  Error sigma;
  sigma.segment<3>(kPos).setConstant(1e5);
  sigma.segment<3>(kVel).setConstant(1e2);
  sigma.segment<3>(kAtt).setConstant(4.0);
  sigma.segment<3>(kGyroBias).setConstant(1.0);
  sigma.segment<3>(kAccelBias).setConstant(10.0);
  sigma[kWheelScale] = 1.0;
  sigma[kWheelSkew] = 1.0;
  sigma[kTrack] = 1.0;
  sigma[kIcrX] = 1.0;
  sigma.segment<3>(kGnssBias).setConstant(1e3);
  sigma[kHeadingOffset] = 4.0;
  sigma[kDisturbance] = 4.0;
  return sigma.cwiseAbs2();
}

double squared(double v) { return v * v; }

/// The covariance follows the state at least this often; a wheeled robot hardly turns meanwhile.
constexpr double kSettleAfter_s = 0.1;
/// A gyro's bias that jumped: by how much [rad/s], and how long that goes unnoticed [s].
constexpr double kDoubtedBias = 0.01;
constexpr double kDoubted_s = 8.0;
constexpr double kDoubtedPosition_m = 0.3;

/// Usual disturbances of the heading are learnt over this many times their duration ...
constexpr double kDisturbanceMemory = 4.0;
/// ... within these factors of the configured variance.
constexpr double kLeastDisturbance = 0.1;
constexpr double kMostDisturbance = 6.0;

}  // namespace

Gate::Gate(const FilterParams& params) {
  for (int dof = 1; dof <= 3; ++dof) {
    limit_[static_cast<std::size_t>(dof - 1)] =
        metrics::chiSquareQuantile(params.gate_probability, dof);
    soft_[static_cast<std::size_t>(dof - 1)] =
        metrics::chiSquareQuantile(params.down_weight_probability, dof);
  }
}

Shared::Shared(const FilterParams& p)
    : params(p),
      model(p.plane),
      gate(p),
      engine(p.engine == EngineKind::kMrpt ? makeMrptEngine() : makeFixedEngine(p.plane)) {}

Tracker::Tracker(const Shared& shared, Pose mode) : shared_(&shared), mode_(mode) {
  start({}, nullptr);
}

void Tracker::start(const PoseWithCovariance& T, const Tracker* learnt) {
  is_pending_ = false;
  const FilterParams& p = shared_->params;
  if (tape_ != nullptr) tape_->cut();
  State x;
  StateMatrix P = StateMatrix::Zero();
  P.diagonal().segment<3>(kGyroBias).setConstant(squared(p.gyro.bias_sigma_radps));
  P.diagonal().segment<3>(kAccelBias).setConstant(squared(p.accel.bias_sigma_mps2));
  P(kWheelScale, kWheelScale) = squared(p.wheels.scale_sigma);
  P(kWheelSkew, kWheelSkew) = squared(p.wheels.skew_sigma_rad_per_m);
  P(kTrack, kTrack) = squared(p.wheels.track_sigma);
  P(kIcrX, kIcrX) = squared(p.wheels.icr_sigma_m);
  double roll = 0.0;
  double pitch = 0.0;
  double tilt_var = squared(kUnknownTilt);
  if (learnt != nullptr) {
    x = learnt->x_;
    for (int i = kGyroBias; i < kGnssBias; ++i) P(i, i) = learnt->P_(i, i);
    const Pose3 T_before = learnt->x_.pose3();
    roll = T_before.roll;
    pitch = T_before.pitch;
    if (learnt->tilt_known_)
      tilt_var = std::max(learnt->P_(kAtt, kAtt), learnt->P_(kAtt + 1, kAtt + 1));
    tilt_known_ = learnt->tilt_known_;
  }
  x.p = Eigen::Vector3d(T.mean.x, T.mean.y, learnt != nullptr ? learnt->x_.p.z() : 0.0);
  const Eigen::Quaterniond q = attitudeOf(wrapToPi(T.mean.phi), pitch, roll);
  x.v = q * (x_.q.conjugate() * x_.v);
  x.q = q;
  x.gnss_bias.setZero();
  x.heading_offset = 0.0;
  x.disturbance = 0.0;
  P(kAtt, kAtt) = P(kAtt + 1, kAtt + 1) = tilt_var;
  const int index[3] = {kPos, kPos + 1, kAtt + 2};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) P(index[i], index[j]) = T.cov(i, j);
  }
  P(kPos + 2, kPos + 2) = std::max(T.cov(0, 0), T.cov(1, 1));
  P.diagonal().segment<3>(kGnssBias).setConstant(squared(gnss_.slow_sigma_m));
  P(kHeadingOffset, kHeadingOffset) = squared(kUnknownAngle);
  disturbance_var_ = learnt != nullptr && learnt->heading_known_
                         ? learnt->disturbance_var_
                         : squared(p.heading.disturbance_sigma_rad);
  P(kDisturbance, kDisturbance) = disturbance_var_;
  shared_->model.constrain(P);
  x_ = x;
  P_ = P;
  heading_known_ = false;
  heading_rejected_since_.reset();
}

void Tracker::step(Motion& u) {
  u.disturbance_var = disturbance_var_ * (1.0 - squared(u.disturbance_decay));
  if (calibrated_sigma_ > 0.0) {
    u.heading_offset_decay = std::exp(-u.dt_s / shared_->params.heading.calibrated_offset_time_s);
    u.heading_offset_var = squared(calibrated_sigma_) * (1.0 - squared(u.heading_offset_decay));
  }
  if (mode_ == Pose::kCorrected) {
    u.gnss_bias_decay = std::exp(-u.dt_s / gnss_.correlation_s);
    u.gnss_bias_var = squared(gnss_.slow_sigma_m) * (1.0 - squared(u.gnss_bias_decay));
  }
  if (is_pending_ && !pending_.motion.continuedBy(u)) settle();
  if (is_pending_) {
    pending_.motion.append(u);
  } else {
    pending_.from = x_;
    pending_.motion = u;
    is_pending_ = true;
  }
  x_ = shared_->model.transition(x_, u);
  if (!u.rolling || pending_.motion.dt_s >= kSettleAfter_s) settle();
  if (!u.rolling && u.dt_s > 0.0) {
    (void)offer(
        shared_->model.nonHolonomic(x_, u.turn_rad.z() / u.dt_s, kCoastSide_mps, kCoastSide_mps));
  }
}

void Tracker::settle() {
  if (!is_pending_) return;
  const Transition step = shared_->model.linearised(pending_.from, pending_.motion);
  is_pending_ = false;
  if (tape_ != nullptr) tape_->predicted(step);
  shared_->engine->predict(P_, step);
  keepWithinBounds();
}

void Tracker::keepWithinBounds() {
  static const Error kMost = mostUncertain();
  if (!(P_.diagonal().array() > kMost.array()).any()) return;
  for (int i = 0; i < kStateSize; ++i) {
    if (!(P_(i, i) > kMost[i])) continue;
    // Scaling a row and its column keeps the matrix positive semi-definite.
    const double share = std::sqrt(kMost[i] / P_(i, i));
    P_.row(i) *= share;
    P_.col(i) *= share;
  }
}

UpdateReport Tracker::tested(const Observation& z, const Correlation& c) const {
  UpdateReport report;
  report.dof = z.rows;
  report.gate = shared_->gate.limit(report.dof);
  const Innovation innovation = Engine::innovation(z, c);
  report.nis = innovation.nis;
  report.log_det = innovation.log_det;
  if (!(report.nis <= report.gate)) {
    report.decision = Decision::kGated;
    report.reason = "chi2";
  }
  return report;
}

UpdateReport Tracker::offer(Observation&& z, double inflation) {
  if (!z.finite()) {
    UpdateReport report;
    report.decision = Decision::kRejected;
    report.reason = "not finite";
    return report;
  }
  settle();
  const Correlation c = Engine::correlation(P_, z);
  UpdateReport report = tested(z, c);
  if (report.decision == Decision::kGated) return report;
  const double soft = shared_->gate.soft(report.dof);
  if (report.nis > soft) {
    report.decision = Decision::kDownWeighted;
    report.reason = "chi2";
    inflation *= report.nis / soft;
  }
  z.R *= inflation;
  update(z, c);
  return report;
}

void Tracker::update(const Observation& z, const Correlation& c) {
  if (tape_ != nullptr) tape_->updated(P_, z);
  Error correction = shared_->engine->update(P_, z, c);
  if (mode_ == Pose::kContinuous) {
    correction.segment<3>(kPos).setZero();
    // Learning the bias would turn the robot by all that the wrong bias turned it so far.
    if (z.H(0, kAtt + 2) == 0.0) correction[kAtt + 2] = 0.0;
  }
  x_ = plus(x_, correction);
}

UpdateReport Tracker::offerHeading(const Heading& heading) {
  const HeadingParams& p = shared_->params.heading;
  const Model& model = shared_->model;
  const double sigma = std::max(heading.sigma_rad.value_or(0.0), p.sigma_rad);
  if (mode_ == Pose::kCorrected) calibrated_sigma_ = heading.offset_sigma_rad.value_or(0.0);
  if (!heading_known_) {
    const double difference = angleDiff(heading.yaw_rad, x_.yaw());
    const double offset_sigma = calibrated_sigma_ > 0.0 ? calibrated_sigma_ : p.offset_sigma_rad;
    const double usual =
        std::sqrt(squared(offset_sigma) + disturbance_var_ + squared(sigmaOf(kAtt + 2)));
    learnHeadingOffset(0.0, offset_sigma);
    if (mode_ == Pose::kContinuous || std::abs(difference) >= 2.0 * usual) doubtHeading(difference);
    heading_known_ = true;
    UpdateReport report = offer(model.heading(x_, heading.yaw_rad, sigma));
    report.reason = "initialised";
    return report;
  }
  Observation z = model.heading(x_, heading.yaw_rad, sigma);
  const double residual_rad = z.residual[0];
  UpdateReport report = offer(std::move(z));
  learnDisturbance(report, heading, residual_rad);
  if (report.decision != Decision::kGated) {
    heading_rejected_since_.reset();
    return report;
  }
  if (!heading_rejected_since_) heading_rejected_since_ = heading.stamp;
  if (toSeconds(heading.stamp - *heading_rejected_since_) > p.relearn_after_s) {
    // The sensor keeps saying so: whatever turned it, it can be used again from here on.
    doubtHeading(angleDiff(heading.yaw_rad, x_.yaw()));
    heading_rejected_since_.reset();
    (void)offer(model.heading(x_, heading.yaw_rad, sigma));
    report.reason = "relearn";
  }
  return report;
}

void Tracker::replace(int first, int count, double variance) {
  settle();
  if (tape_ != nullptr) tape_->replaced(first, count);
  for (int i = first; i < first + count; ++i) {
    P_.row(i).setZero();
    P_.col(i).setZero();
    P_(i, i) = variance;
  }
}

void Tracker::learnHeadingOffset(double mean_rad, double sigma_rad) {
  x_.heading_offset = mean_rad;
  x_.disturbance = 0.0;
  replace(kHeadingOffset, 1, squared(sigma_rad));
  replace(kDisturbance, 1, disturbance_var_);
}

void Tracker::doubtHeading(double difference_rad) {
  if (calibrated_sigma_ == 0.0) {
    learnHeadingOffset(difference_rad, kUnknownAngle);
    return;
  }
  x_.disturbance = difference_rad - x_.heading_offset;
  replace(kDisturbance, 1, squared(kUnknownAngle));
}

void Tracker::learnDisturbance(
    const UpdateReport& report, const Heading& heading, double residual_rad) {
  const HeadingParams& p = shared_->params.heading;
  // Expectation maximisation for the stationary variance: the mean of what the disturbance's square
  // is expected to be. Where the reading was refused, the whole difference is a disturbance.
  const double square = report.decision == Decision::kGated
                            ? squared(x_.disturbance + residual_rad)
                            : squared(x_.disturbance) + P_(kDisturbance, kDisturbance);
  const double dt_s = last_heading_ ? toSeconds(heading.stamp - *last_heading_) : 0.0;
  last_heading_ = heading.stamp;
  const double share = 1.0 - std::exp(-dt_s / (kDisturbanceMemory * p.disturbance_time_s));
  const double configured = squared(p.disturbance_sigma_rad);
  disturbance_var_ = std::clamp(
      disturbance_var_ + share * (square - disturbance_var_),
      kLeastDisturbance * configured,
      kMostDisturbance * configured);
}

void Tracker::offerTilt(double roll_rad, double pitch_rad, double sigma_rad) {
  if (shared_->model.planar()) return;
  if (!tilt_known_) {
    tilt_known_ = true;
    x_.q = attitudeOf(x_.yaw(), pitch_rad, roll_rad);
    replace(kAtt, 2, squared(sigma_rad));
    return;
  }
  (void)offer(shared_->model.tilt(x_, roll_rad, pitch_rad, sigma_rad));
}

void Tracker::offerGravity(const Eigen::Vector3d& force_mps2, const Eigen::Vector3d& own_mps2) {
  if (shared_->model.planar()) return;
  const double sigma = shared_->params.accel.tilt_sigma_mps2;
  if (!tilt_known_) {
    const double roll = std::atan2(force_mps2.y(), force_mps2.z());
    const double pitch = std::atan2(-force_mps2.x(), std::hypot(force_mps2.y(), force_mps2.z()));
    offerTilt(roll, pitch, sigma / force_mps2.norm());
    return;
  }
  (void)offer(shared_->model.gravity(x_, force_mps2, own_mps2, sigma), kLevelInflation);
}

void Tracker::offerZeroRate(const Eigen::Vector3d& omega_radps, double sigma_radps) {
  (void)offer(shared_->model.zeroRate(x_, omega_radps, sigma_radps), kZeroRateInflation);
}

UpdateReport Tracker::offerWheelTurn(
    double wheels_rad, double gyro_rad, double forward_m, double dt_s) {
  settle();
  const WheelParams& p = shared_->params.wheels;
  const double sigma = std::hypot(
      p.yaw_sigma_per_rad * std::sqrt(std::abs(wheels_rad)),
      std::hypot(
          p.yaw_sigma_sqrt_m * std::sqrt(std::abs(forward_m)),
          std::hypot(
              shared_->params.gyro.noise_rad_sqrt_s * std::sqrt(dt_s),
              sigmaOf(kGyroBias + 2) * dt_s)));
  return offer(shared_->model.wheelTurn(x_, wheels_rad, gyro_rad, forward_m, dt_s, sigma));
}

void Tracker::setGnssNoise(const GnssNoise& noise, bool forget_slow_error) {
  gnss_ = noise;
  if (forget_slow_error) forgetGnssError();
}

void Tracker::forgetGnssError() {
  x_.gnss_bias.setZero();
  replace(kGnssBias, 3, squared(gnss_.slow_sigma_m));
  shared_->model.constrain(P_);
}

Tracker::GnssTest Tracker::testGnss(
    const Eigen::Vector3d& p_map_antenna, const Eigen::Vector3d& p_base_antenna) const {
  Observation z = shared_->model.gnssPosition(x_, p_map_antenna, p_base_antenna, gnss_.white);
  GnssTest result;
  result.against_last = tested(z, Engine::correlation(P_, z));
  z.residual += x_.gnss_bias;
  z.H.middleCols<3>(kGnssBias).setZero();
  z.R += squared(gnss_.slow_sigma_m) * Eigen::Matrix3d::Identity();
  result.against_any = tested(z, Engine::correlation(P_, z));
  result.residual = z.residual.head<2>();
  return result;
}

MapFilter::Expected Tracker::expectedFix(const Eigen::Vector3d& p_base_antenna) const {
  const Observation z =
      shared_->model.gnssPosition(x_, Eigen::Vector3d::Zero(), p_base_antenna, gnss_.white);
  MapFilter::Expected result;
  result.p_map_antenna = -z.residual.head<2>();
  result.cov = Engine::innovation(z, Engine::correlation(P_, z)).S.topLeftCorner<2, 2>();
  return result;
}

UpdateReport Tracker::useGnss(
    const Eigen::Vector3d& p_map_antenna, const Eigen::Vector3d& p_base_antenna, double inflation) {
  return offer(
      shared_->model.gnssPosition(x_, p_map_antenna, p_base_antenna, gnss_.white), inflation);
}

void Tracker::positionFromGnss(std::optional<double> height_m) {
  if (height_m && !shared_->model.planar()) x_.p.z() = *height_m;
  const int axes = shared_->model.planar() ? 2 : 3;
  // No more than the position errs by in its surest direction: a fix may claim a thin ellipse.
  const Eigen::MatrixXd P_position = P_.block(kPos, kPos, axes, axes);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(P_position, Eigen::EigenvaluesOnly);
  const double shared =
      std::min(squared(gnss_.slow_sigma_m), 0.999 * std::max(0.0, eigen.eigenvalues()[0]));
  for (int i = 0; i < axes; ++i) {
    P_(kPos + i, kGnssBias + i) = P_(kGnssBias + i, kPos + i) = -shared;
  }
}

void Tracker::doubtMotion(bool turned) {
  settle();
  Transition doubt;  // nothing moves
  if (turned) {
    doubt.rest_noise[kGyroBias + 2 - Transition::kTop] = squared(kDoubtedBias);
    doubt.top_noise(kAtt + 2, kAtt + 2) = squared(kDoubtedBias * kDoubted_s);
  }
  doubt.top_noise(kPos, kPos) = doubt.top_noise(kPos + 1, kPos + 1) = squared(kDoubtedPosition_m);
  if (tape_ != nullptr) tape_->predicted(doubt);
  shared_->engine->predict(P_, doubt);
}

void Tracker::resetPosition(const Eigen::Vector2d& p, const Eigen::Matrix2d& cov) {
  x_.p.head<2>() = p;
  replace(kPos, 2, 1.0);
  P_.topLeftCorner<2, 2>() = cov;
}

PoseWithCovariance Tracker::pose() const {
  PoseWithCovariance T;
  T.mean = x_.pose2();
  const int index[3] = {kPos, kPos + 1, kAtt + 2};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) T.cov(i, j) = P_(index[i], index[j]);
  }
  return T;
}

double Tracker::sigmaOf(int index) const { return std::sqrt(std::max(0.0, P_(index, index))); }

}  // namespace vestibule::ekf
