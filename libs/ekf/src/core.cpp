#include "core.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "vestibule/core/angles.hpp"
#include "vestibule/ekf/claims.hpp"

namespace vestibule::ekf {
namespace {

/// A heading reading is of use for starting up for this long.
constexpr double kHeadingAge_s = 1.0;
/// Share of an interval between readings by which it may be short.
constexpr double kEarly = 0.05;
/// By so much a receiver's velocity may lag.
constexpr double kVelocityLag_s = 0.1;

/// Fixes creep: so far from one to the next [sigma], for so long.
constexpr double kCreepSigmas = 5.0;
constexpr double kCreep_s = 1.0;
/// Variances raised by less are not worth saying.
constexpr double kWorthSaying = 1.1;

std::string oneDecimal(double value) {
  const auto tenths = static_cast<int>(std::lround(10.0 * value));
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10);
}

/// Notes in what became of a measurement by how much its variance was raised.
void tellNoise(UpdateReport& report, double scale) {
  if (report.decision != Decision::kAccepted || !report.reason.empty() || scale < kWorthSaying) {
    return;
  }
  report.decision = Decision::kDownWeighted;
  report.reason = "noise x" + oneDecimal(scale);
}

UpdateReport rejected(std::string reason) {
  UpdateReport report;
  report.decision = Decision::kRejected;
  report.reason = std::move(reason);
  return report;
}

}  // namespace

Core::Core(const Shared& shared, const SensorRig& rig)
    : shared_(&shared),
      rig_(&rig),
      reckoning_(shared.params),
      odometry_(shared, Tracker::Pose::kContinuous),
      map_(shared, Tracker::Pose::kCorrected),
      alignment_(shared.params),
      bank_(shared.params),
      realignment_(shared.params),
      screen_(shared.params, rig.p_base_antenna),
      drift_(shared.params.gnss.drift_window_s),
      fix_noise_{NoiseScale(shared.params), NoiseScale(shared.params), NoiseScale(shared.params)},
      velocity_noise_(shared.params) {}

UpdateReport Core::apply(const Input& input) {
  return std::visit([this](const auto& m) { return take(m); }, input);
}

void Core::step(Motion&& u) {
  const Eigen::Vector3d before = odometry_.state().p;
  odometry_.step(u);
  if (!u.rolling) {
    const State& x = odometry_.state();
    reckoning_.coasted((x.q.conjugate() * Eigen::Vector3d(x.p - before)).x());
  }
  if (ready_) map_.step(u);
}

void Core::advance(Timestamp stamp) {
  Motion u = reckoning_.advance(stamp);
  if (u.dt_s > 0.0) step(std::move(u));
  odometry_.settle();
  if (ready_) map_.settle();
}

UpdateReport Core::take(const Imu& imu) {
  step(reckoning_.process(imu, odometry_.state().gyro_bias));
  if (reckoning_.standstill() && last_imu_ && params().use.imuYawRate()) {
    const double interval_s = std::max(1e-3, toSeconds(imu.stamp - *last_imu_));
    const GyroParams& gyro = params().gyro;
    const double of_reading = 1.0 / std::sqrt(interval_s);
    const double sigma = rest_noise_.note(
        reckoning_.rate(),
        gyro.noise_rad_sqrt_s * of_reading,
        gyro.rest_noise_rad_sqrt_s * of_reading);
    odometry_.offerZeroRate(reckoning_.rate(), sigma);
    if (ready_) map_.offerZeroRate(reckoning_.rate(), sigma);
  } else {
    rest_noise_.restart();
  }
  if (!params().plane && params().use.imuAcceleration() && reckoning_.hasForce()) {
    const Eigen::Vector3d own = reckoning_.ownAcceleration(odometry_.state().gyro_bias);
    odometry_.offerGravity(reckoning_.force(), own);
    if (ready_) map_.offerGravity(reckoning_.force(), own);
  }
  last_imu_ = imu.stamp;
  return {};
}

UpdateReport Core::take(const WheelOdometry& wheels) {
  step(reckoning_.process(wheels));
  const auto& turn = reckoning_.wheelTurn();
  if (turn && std::max(std::abs(turn->gyro_rad), std::abs(turn->wheels_rad)) >
                  params().wheels.learn_above_radps * turn->dt_s) {
    const auto offer = [&turn](Tracker& tracker) {
      return tracker.offerWheelTurn(turn->wheels_rad, turn->gyro_rad, turn->forward_m, turn->dt_s);
    };
    // Wheels that turn as the robot does not are slipping, forwards too.
    if (offer(odometry_).decision == Decision::kGated) reckoning_.slipped();
    if (ready_) (void)offer(map_);
  }
  return {};
}

UpdateReport Core::take(const Heading& heading) {
  // The error of readings closer together is the same.
  const double interval_s = (1.0 - kEarly) * params().heading.min_interval_s;
  if (last_heading_ && toSeconds(heading.stamp - *last_heading_) < interval_s) {
    return rejected(kTooSoon);
  }
  last_heading_ = heading.stamp;
  advance(heading.stamp);
  const UseParams& use = params().use;
  if (heading.tilt && use.headingTilt()) {
    const double sigma = params().heading.tilt_sigma_rad;
    odometry_.offerTilt(heading.tilt->roll_rad, heading.tilt->pitch_rad, sigma);
    if (ready_) map_.offerTilt(heading.tilt->roll_rad, heading.tilt->pitch_rad, sigma);
  }
  if (!use.headingYaw()) return rejected("not used");
  (void)odometry_.offerHeading(heading);
  heading_ = heading;
  return ready_ ? map_.offerHeading(heading) : rejected("not ready");
}

UpdateReport Core::take(const MapFix& fix) {
  advance(fix.stamp);
  const GnssScreen::Worth worth = screen_.assess(fix);
  if (!worth.refused.empty()) return rejected(worth.refused);
  if (!params().use.gnssPosition()) return rejected("not used");
  setGnssNoise(worth);
  return ready_ ? fuse(fix, worth) : initialise(fix, worth);
}

UpdateReport Core::take(const VelocityInput& input) {
  advance(input.stamp);
  if (!params().use.gnssVelocity()) return rejected("not used");
  const GnssVelocity& z = input.velocity;
  const Eigen::Vector3d lever(rig_->p_base_antenna.x, rig_->p_base_antenna.y, 0.0);
  const Eigen::Vector3d gyro_bias = (ready_ ? map_ : odometry_).state().gyro_bias;
  // Receivers filter: a velocity is that of a moment ago.
  const double sigma = std::hypot(
      std::max(z.sigma_mps.value_or(0.0), params().gnss.velocity_sigma_mps),
      kVelocityLag_s * reckoning_.ownAcceleration(gyro_bias).norm());
  const double interval_s =
      last_velocity_ ? std::max(1e-3, toSeconds(input.stamp - *last_velocity_)) : 1e3;
  const double repeats = std::max(1.0, 2.0 * params().gnss.velocity_repeat_s / interval_s);
  last_velocity_ = input.stamp;
  const auto measured = [&](const State& x) {
    return shared_->model.gnssVelocity(
        x, z.enu_mps, lever, reckoning_.rate(), reckoning_.rateIsGyro(), sigma);
  };
  if (ready_) {
    const double scale = velocity_noise_.value();
    UpdateReport report = map_.offer(measured(map_.state()), std::max(repeats, scale));
    velocity_noise_.note(input.stamp, report.dof == 0 ? std::nan("") : report.nis / report.dof);
    if (scale > repeats) tellNoise(report, scale);
    return report;
  }

  const State& x = odometry_.state();
  const Observation by_odometry = measured(x);
  const Eigen::Vector2d v_odom = z.enu_mps.head<2>() - by_odometry.residual.head<2>();
  bank_.add(z.enu_mps.head<2>(), v_odom, sigma * std::sqrt(repeats));
  const auto found = bank_.solve();
  if (!found || !last_fix_ || last_fix_->fix.stamp != input.stamp) return rejected("not ready");
  begin(
      last_fix_->fix, last_fix_->R, wrapToPi(found->yaw_map_odom_rad + x.yaw()), found->sigma_rad);
  screen_.accepted(last_fix_->fix);
  UpdateReport report;
  report.reason = "initialised";
  return report;
}

UpdateReport Core::take(const PoseInput& pose) {
  advance(pose.stamp);
  if (ready_) return map_.offer(shared_->model.pose(map_.state(), pose.T_map_base));
  begin(pose.T_map_base);
  UpdateReport report;
  report.reason = "initialised";
  return report;
}

UpdateReport Core::take(const ResetInput& reset) {
  advance(reset.stamp);
  begin(reset.T_map_base);
  UpdateReport report;
  report.reason = "reset";
  return report;
}

void Core::begin(const PoseWithCovariance& T_map_base) {
  map_.start(T_map_base, ready_ ? &map_ : &odometry_);
  if (!ready_) {
    initial_alignment_ = compose(T_map_base, inverse(odometry_.pose().mean));
  }
  ready_ = true;
  screen_.forget();
  drift_.forget();
  jumped_since_.reset();
  if (heading_ && toSeconds(reckoning_.time() - heading_->stamp) < kHeadingAge_s) {
    (void)map_.offerHeading(*heading_);
  }
}

void Core::begin(
    const MapFix& fix, const Eigen::Matrix3d& R, double yaw_rad, double yaw_sigma_rad) {
  const Point2 lever = transform(Pose2(0, 0, yaw_rad), rig_->p_base_antenna);
  PoseWithCovariance T;
  T.mean = Pose2(fix.p_map_antenna.x() - lever.x, fix.p_map_antenna.y() - lever.y, yaw_rad);
  T.cov.topLeftCorner<2, 2>() = R.topLeftCorner<2, 2>();
  T.cov(2, 2) = yaw_sigma_rad * yaw_sigma_rad;
  begin(T);
  map_.positionFromGnss(fix.p_map_antenna.z());
}

void Core::begin(const TrackAlignment::Result& found, const MapFix& fix) {
  PoseWithCovariance T;
  T.mean = compose(found.T_map_odom, odometry_.pose().mean);
  const double position_var = found.position_sigma_m * found.position_sigma_m;
  T.cov.diagonal() << position_var, position_var, found.yaw_sigma_rad * found.yaw_sigma_rad;
  begin(T);
  map_.positionFromGnss(fix.p_map_antenna.z());
}

UpdateReport Core::initialise(const MapFix& fix, const GnssScreen::Worth& worth) {
  UpdateReport report = rejected("not ready");
  last_fix_ = UsableFix{fix, worth.R};
  const Pose2 T_odom_base = odometry_.pose().mean;
  const bool is_fresh =
      heading_ && std::abs(toSeconds(fix.stamp - heading_->stamp)) < kHeadingAge_s;
  const auto yaw_sigma = is_fresh ? absoluteSigma(*heading_, params()) : std::nullopt;
  if (yaw_sigma) {
    begin(fix, worth.R, heading_->yaw_rad, *yaw_sigma);
  } else {
    alignment_.add(
        fix.stamp,
        fix.p_map_antenna.head<2>(),
        transform(T_odom_base, rig_->p_base_antenna),
        worth.sigma_m);
    const auto found = alignment_.solve();
    if (!found) return report;
    begin(*found, fix);
  }
  screen_.accepted(fix);
  report.decision = Decision::kAccepted;
  report.reason = "initialised";
  return report;
}

void Core::setGnssNoise(const GnssScreen::Worth& worth) {
  const GnssErrorModel error = errorModel(worth.kind, params().gnss);
  Tracker::GnssNoise noise;
  noise.slow_sigma_m = error.slow_share * worth.sigma_m;
  noise.correlation_s = error.correlation_s;
  noise.white = (1.0 - error.slow_share * error.slow_share) * worth.R;
  // Corrections come and go, code errors stay; carrier-phase fixes err in another way.
  const bool carrier_phase = worth.kind == FixKind::kCarrierPhase;
  const bool otherwise = !fix_kind_ || (*fix_kind_ == FixKind::kCarrierPhase) != carrier_phase;
  map_.setGnssNoise(noise, otherwise);
  fix_kind_ = worth.kind;
}

UpdateReport Core::fuse(const MapFix& fix, const GnssScreen::Worth& worth) {
  const Eigen::Vector3d lever(rig_->p_base_antenna.x, rig_->p_base_antenna.y, 0.0);
  Tracker::GnssTest test = map_.testGnss(fix.p_map_antenna, lever);
  // Of the two reasons to doubt a fix, that it repeats the last one and that such fixes turned out
  // worse than they claim, the greater counts: one error is behind both.
  const double scale = fixNoise(worth.kind).value();
  fixNoise(worth.kind).note(fix.stamp, test.against_any.nis / test.against_any.dof);
  if (doubtMotion(fix, worth, test)) test = map_.testGnss(fix.p_map_antenna, lever);
  const double drift_nis = driftNis(fix, worth);
  const bool drifts = drift_nis > shared_->gate.limit(2);
  if (screen_.tooFast(fix, worth.sigma_m)) {
    test.against_any.decision = Decision::kGated;
    test.against_any.reason = "speed";
  } else if (drifts && test.against_any.decision != Decision::kGated) {
    test.against_any.decision = Decision::kGated;
    test.against_any.reason = "drift";
    test.against_any.nis = drift_nis;
  }
  if (test.against_any.decision == Decision::kGated) {
    if (!recover(fix, worth)) return test.against_any;
    trustGnss(fix);
    test.against_any.decision = Decision::kAccepted;
    test.against_any.reason = "reset";
    return test.against_any;
  }
  std::string reason;
  if (test.against_last.decision == Decision::kGated) {
    if (!jumped_since_) jumped_since_ = fix.stamp;
    if (toSeconds(fix.stamp - *jumped_since_) < params().gnss.relearn_after_s) {
      test.against_last.reason = "jump";
      return test.against_last;
    }
    // The fixes stay where they jumped to, which is a usual place: another slow error.
    map_.forgetGnssError();
    reason = "relearn";
  }
  const double doubt = std::max(1.0, drift_nis / shared_->gate.soft(2));
  UpdateReport report =
      map_.useGnss(fix.p_map_antenna, lever, doubt * std::max(worth.repeats, scale));
  if (!reason.empty()) report.reason = reason;
  if (scale > worth.repeats) tellNoise(report, scale);
  if (report.decision == Decision::kGated) return report;
  trustGnss(fix);
  if (doubt > 1.0) {
    report.decision = Decision::kDownWeighted;
    report.reason = "drift";
  } else {
    drift_.good(seenByBoth(fix));
  }
  return report;
}

MapFilter::Expected Core::expected(const MapFix& fix) {
  advance(fix.stamp);
  const double sigma_m = screen_.assess(fix).sigma_m;
  GnssScreen::Worth worth;
  worth.sigma_m = sigma_m;
  worth.R = sigma_m * sigma_m * Eigen::Matrix3d::Identity();
  worth.kind = fix_kind_.value_or(FixKind::kCode);
  setGnssNoise(worth);
  const Eigen::Vector3d lever(rig_->p_base_antenna.x, rig_->p_base_antenna.y, 0.0);
  return map_.expectedFix(lever);
}

bool Core::doubtMotion(
    const MapFix& fix, const GnssScreen::Worth& worth, const Tracker::GnssTest& test) {
  const bool follows = last_miss_ &&
                       toSeconds(fix.stamp - last_miss_->stamp) < params().gnss.gap_s &&
                       (test.residual - last_miss_->by_m).norm() < kCreepSigmas * worth.sigma_m;
  last_miss_ = Miss{fix.stamp, test.residual};
  if (!follows) creeping_ = false;
  const bool refused = test.against_any.decision == Decision::kGated ||
                       test.against_last.decision == Decision::kGated;
  if (!refused || !creeping_ || worth.kind != FixKind::kCarrierPhase) return false;
  if (!crept_since_) crept_since_ = fix.stamp;
  if (toSeconds(fix.stamp - *crept_since_) < kCreep_s) return false;
  const double yaw = map_.state().yaw();
  const Eigen::Vector2d nose(std::cos(yaw), std::sin(yaw));
  const double ahead_m = std::abs(nose.dot(test.residual));
  map_.doubtMotion(test.residual.squaredNorm() > 2.0 * ahead_m * ahead_m);
  creeping_ = false;
  return true;
}

void Core::trustGnss(const MapFix& fix) {
  creeping_ = true;
  crept_since_.reset();
  screen_.accepted(fix);
  realignment_ = TrackAlignment(params());
  refused_since_.reset();
  jumped_since_.reset();
}

GnssDrift::Fix Core::seenByBoth(const MapFix& fix) const {
  const Point2 p_odom = transform(odometry_.pose().mean, rig_->p_base_antenna);
  return {fix.stamp, fix.p_map_antenna.head<2>(), {p_odom.x, p_odom.y}};
}

double Core::driftNis(const MapFix& fix, const GnssScreen::Worth& worth) const {
  // Carrier-phase fixes do not wander: where they creep away it is the motion that is wrong. With
  // corrections the error moves as fast as the corrections change, and stays small.
  if (worth.kind != FixKind::kCode) return 0.0;
  GnssDrift::Noise noise;
  noise.sigma_m = worth.sigma_m;
  noise.correlation_s = errorModel(worth.kind, params().gnss).correlation_s;
  noise.yaw_sigma_rad = map_.sigmaOf(kAtt + 2);
  return drift_.nis(seenByBoth(fix), map_.state().yaw() - odometry_.state().yaw(), noise);
}

bool Core::recover(const MapFix& fix, const GnssScreen::Worth& worth) {
  const Pose2 T_odom_base = odometry_.pose().mean;
  const auto cluster = screen_.refused(fix, worth.sigma_m, T_odom_base, map_.state().yaw());
  if (cluster) {
    map_.resetPosition(cluster->p_map_base, cluster->cov);
    map_.forgetGnssError();
    map_.positionFromGnss(std::nullopt);
    drift_.forget();
    return true;
  }
  if (!refused_since_) refused_since_ = fix.stamp;
  realignment_.add(
      fix.stamp,
      fix.p_map_antenna.head<2>(),
      transform(T_odom_base, rig_->p_base_antenna),
      worth.sigma_m);
  if (toSeconds(fix.stamp - *refused_since_) < params().recovery.realign_after_s ||
      realignment_.extent() < params().recovery.travel(worth.sigma_m)) {
    return false;
  }
  const auto found = realignment_.solve();
  if (!found) return false;
  begin(*found, fix);
  return true;
}

std::string Core::waitingFor() const {
  if (ready_) return {};
  if (!started()) return "first wheel or IMU message";
  if (alignment_.size() == 0) return "GNSS fix";
  const double missing_m = std::max(0.0, params().init.min_travel_m - alignment_.extent());
  return "heading: yaw not observable yet, drive " +
         (missing_m > 0.0 ? std::to_string(static_cast<int>(std::ceil(missing_m))) + " m"
                          : std::string("on")) +
         " with GNSS (" + std::to_string(alignment_.size()) + " fixes over " +
         std::to_string(static_cast<int>(alignment_.extent())) + " m so far)";
}

Pose2 carriedOn(const Model& model, const Core& core, const State& x, Timestamp stamp) {
  const Timestamp limit = core.time() + std::chrono::milliseconds(500);
  const Timestamp until = std::clamp(stamp, core.time(), limit);
  return model.transition(x, core.reckoning().ahead(until)).pose2();
}

}  // namespace vestibule::ekf
