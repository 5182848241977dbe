#include "vestibule/mode_manager/mode_manager.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdio>

#include "vestibule/core/angles.hpp"
#include "vestibule/metrics/statistics.hpp"

namespace vestibule::mode_manager {
namespace {

// Smallest differences worth calling a disagreement: discretisation of the map, its georeference.
constexpr double kAgreeFloor_m = 0.25;
constexpr double kAgreeFloor_rad = degToRad(2.0);
// Particles are drawn from at least this much, so that the filter can move.
constexpr double kSeedFloor_m = 0.4;
constexpr double kSeedFloor_rad = degToRad(3.0);
// Growth of the published uncertainty while no estimator has authority.
constexpr double kDeadReckoningShare = 0.03;
// An estimate offered longer ago than this has stopped.
constexpr double kEstimateTimeout_s = 1.5;

double sigmaXy(const Eigen::Matrix3d& cov) { return std::sqrt(std::max(cov(0, 0), cov(1, 1))); }

Pose2 correctionOf(const Estimate& e) { return compose(e.T_map_base.mean, inverse(e.T_odom_base)); }

std::string text(const char* format, double a, double b = 0.0) {
  char buffer[160];
  std::snprintf(buffer, sizeof buffer, format, a, b);
  return buffer;
}

}  // namespace

ModeManager::ModeManager(
    const ModeManagerParams& params, geo::Site site, const Observers* observers)
    : params_(params), site_(std::move(site)), observers_(observers), slewer_(params.slew) {}

void ModeManager::offerGnss(const Estimate& estimate, std::optional<Timestamp> last_fix) {
  if (!isFinite(estimate.T_map_base.mean)) return;
  gnss_ = estimate;
  last_fix_ = last_fix;
}

void ModeManager::offerParticles(const Estimate& estimate, double trust) {
  if (!isFinite(estimate.T_map_base.mean)) return;
  particles_ = estimate;
  trust_ = trust;
}

bool ModeManager::heldFor(
    std::optional<Timestamp>& since, bool condition, Timestamp now, double hold_s) {
  if (!condition) {
    since.reset();
    return false;
  }
  if (!since) since = now;
  return toSeconds(now - *since) >= hold_s;
}

const std::optional<Estimate>& ModeManager::authority() const {
  return mode_ == Mode::kIndoor ? particles_ : gnss_;
}

ModeManager::Evidence ModeManager::weigh(Timestamp stamp) const {
  const EvidenceParams& p = params_.evidence;
  Evidence e;
  Point2 here;
  if (slewer_.started()) {
    const Pose2 base = compose(slewer_.T_map_odom(), T_odom_base_);
    here = {base.x, base.y};
  } else if (gnss_) {
    here = {gnss_->T_map_base.mean.x, gnss_->T_map_base.mean.y};
  } else if (particles_) {
    here = {particles_->T_map_base.mean.x, particles_->T_map_base.mean.y};
  }
  e.building_m = geo::distanceToBuildings(site_, here);

  e.gnss = gnss_ && last_fix_ && toSeconds(stamp - *last_fix_) <= p.max_fix_age_s &&
           toSeconds(stamp - gnss_->stamp) <= kEstimateTimeout_s &&
           sigmaXy(gnss_->T_map_base.cov) <= p.max_gnss_sigma_m;
  const double needed_trust = mode_ == Mode::kIndoor ? p.keep_trust : p.enter_trust;
  e.particles = particles_ && toSeconds(stamp - particles_->stamp) <= p.max_particle_age_s &&
                sigmaXy(particles_->T_map_base.cov) <= p.max_particle_sigma_m &&
                trust_ >= needed_trust;

  if (gnss_ && particles_) {
    // Both carried to now by the same odometry, and compared at the base.
    const Pose2 a = compose(correctionOf(*gnss_), T_odom_base_);
    const Pose2 b = compose(correctionOf(*particles_), T_odom_base_);
    const Eigen::Vector3d d(a.x - b.x, a.y - b.y, angleDiff(a.phi, b.phi));
    Eigen::Matrix3d S = gnss_->T_map_base.cov + particles_->T_map_base.cov;
    const double floor_m2 =
        p.gnss_bias_sigma_m * p.gnss_bias_sigma_m + kAgreeFloor_m * kAgreeFloor_m;
    S += Eigen::Vector3d(floor_m2, floor_m2, kAgreeFloor_rad * kAgreeFloor_rad).asDiagonal();
    e.mahalanobis2 = d.dot(S.ldlt().solve(d));
    e.agree = e.mahalanobis2 < metrics::chiSquareQuantile(p.agree_probability, 3);
  }
  return e;
}

void ModeManager::enter(
    Timestamp stamp, Mode mode, const std::string& reason, const Evidence& evidence) {
  if (mode == mode_) return;
  ModeEvent event;
  event.stamp = stamp;
  event.from = mode_;
  event.to = mode;
  event.reason = reason;
  event.values = {
      {"trust", trust_},
      {"building_m", evidence.building_m},
      {"mahalanobis2", evidence.mahalanobis2},
      {"gnss_sigma_m", gnss_ ? sigmaXy(gnss_->T_map_base.cov) : -1.0},
      {"particles_sigma_m", particles_ ? sigmaXy(particles_->T_map_base.cov) : -1.0}};
  mode_ = mode;
  dead_reckoned_m_ = 0.0;
  particles_good_since_.reset();
  particles_bad_since_.reset();
  gnss_good_since_.reset();
  gnss_bad_since_.reset();
  away_since_.reset();
  if (observers_ != nullptr) observers_->emit(event);
}

void ModeManager::decide(Timestamp stamp, const Evidence& e) {
  const HysteresisParams& h = params_.hysteresis;
  if (forced_) {
    const bool available = *forced_ == Mode::kIndoor ? particles_.has_value() : gnss_.has_value();
    if (available) enter(stamp, *forced_, "forced", e);
    return;
  }

  // Where GNSS is there too, the map must agree with it before it gets authority.
  const bool map_eligible = e.particles && e.building_m < params_.zones.enter_within_m &&
                            (mode_ == Mode::kLost || !gnss_ || !e.gnss || e.agree);
  const bool map_ready = heldFor(particles_good_since_, map_eligible, stamp, h.enter_hold_s);
  const bool map_failed = heldFor(particles_bad_since_, !e.particles, stamp, h.loss_hold_s);
  const bool gnss_ready = heldFor(gnss_good_since_, e.gnss, stamp, h.leave_hold_s);
  const bool gnss_failed = heldFor(gnss_bad_since_, !e.gnss, stamp, h.loss_hold_s);

  switch (mode_) {
    case Mode::kOutdoor:
      if (map_ready) {
        enter(
            stamp,
            Mode::kIndoor,
            text("scan fits the map (trust %.2f) %.1f m from the building", trust_, e.building_m),
            e);
      } else if (gnss_failed) {
        enter(stamp, Mode::kDeadReckoning, "no accepted fix", e);
      }
      break;
    case Mode::kIndoor: {
      const bool away = heldFor(
          away_since_,
          e.gnss && e.building_m > params_.zones.leave_beyond_m,
          stamp,
          h.leave_hold_s);
      if (away) {
        enter(
            stamp,
            Mode::kOutdoor,
            text("%.1f m from the building and GNSS is healthy", e.building_m),
            e);
      } else if (map_failed && gnss_ready && e.building_m > 0.0) {
        enter(
            stamp,
            Mode::kOutdoor,
            text("scan no longer fits the map (trust %.2f), GNSS is healthy", trust_),
            e);
      } else if (map_failed) {
        enter(
            stamp, Mode::kDeadReckoning, text("scan does not fit the map (trust %.2f)", trust_), e);
      }
      break;
    }
    case Mode::kDeadReckoning:
    case Mode::kLost:
      if (map_ready) {
        enter(stamp, Mode::kIndoor, text("scan fits the map (trust %.2f)", trust_), e);
      } else if (gnss_ready && e.building_m > 0.0) {
        enter(stamp, Mode::kOutdoor, "GNSS is healthy again", e);
      } else if (mode_ == Mode::kDeadReckoning && dead_reckoned_m_ > h.lost_after_m) {
        enter(
            stamp,
            Mode::kLost,
            text("%.0f m without any position, limit %.0f m", dead_reckoned_m_, h.lost_after_m),
            e);
      }
      break;
  }
}

void ModeManager::updateSeeding(Timestamp stamp, const Evidence& e) {
  particles_wanted_ = e.building_m < params_.zones.seed_within_m && !site_.indoor_maps.empty();
  // Particles at rest say nothing any more: near the next building they start anew.
  if (!particles_wanted_ && mode_ != Mode::kIndoor) particles_.reset();
  if (!particles_wanted_ || !slewer_.started()) return;
  // A forced or granted map authority is not disturbed; a filter that fits the map neither.
  const bool fits = particles_ && trust_ >= params_.evidence.enter_trust && (e.agree || !e.gnss);
  if (fits || mode_ == Mode::kIndoor) return;
  if (last_seed_ && toSeconds(stamp - *last_seed_) < params_.hysteresis.seed_interval_s) return;

  PoseWithCovariance seed = published();
  if (mode_ == Mode::kOutdoor) {
    const double bias = params_.evidence.gnss_bias_sigma_m;
    seed.cov(0, 0) += bias * bias;
    seed.cov(1, 1) += bias * bias;
  }
  for (int i = 0; i < 2; ++i) {
    seed.cov(i, i) = std::max(seed.cov(i, i), kSeedFloor_m * kSeedFloor_m);
  }
  seed.cov(2, 2) = std::max(seed.cov(2, 2), kSeedFloor_rad * kSeedFloor_rad);
  seed_request_ = seed;
  last_seed_ = stamp;
}

void ModeManager::step(Timestamp stamp, const Pose2& T_odom_base) {
  const double moved_m = distance(T_odom_base, T_odom_base_);
  T_odom_base_ = T_odom_base;
  const Evidence evidence = weigh(stamp);

  if (!slewer_.started()) {
    const bool gnss_first = evidence.gnss || (forced_ && *forced_ == Mode::kOutdoor && gnss_);
    if (!gnss_first && !evidence.particles) return;
    mode_ = gnss_first ? Mode::kOutdoor : Mode::kIndoor;
    source_pose_ = authority()->T_map_base;
    slewer_.start(stamp, correctionOf(*authority()));
    ModeEvent event;
    event.stamp = stamp;
    event.from = mode_;
    event.to = mode_;
    event.reason = "first position";
    if (observers_ != nullptr) observers_->emit(event);
  }

  if (mode_ == Mode::kDeadReckoning || mode_ == Mode::kLost) dead_reckoned_m_ += moved_m;
  decide(stamp, evidence);
  updateSeeding(stamp, evidence);

  const bool has_authority =
      (mode_ == Mode::kOutdoor || mode_ == Mode::kIndoor) && authority().has_value();
  if (has_authority) {
    source_pose_ = authority()->T_map_base;
    slewer_.step(stamp, T_odom_base, correctionOf(*authority()));
  } else {
    slewer_.hold(stamp);
    const double growth = kDeadReckoningShare * moved_m;
    source_pose_.cov += Eigen::Vector3d(growth * growth, growth * growth, 1e-6).asDiagonal();
  }

  const double pending_m = translationNorm(slewer_.pending());
  if (pending_m > params_.slew.warn_beyond_m && !warned_ && observers_ != nullptr) {
    WarningEvent event;
    event.stamp = stamp;
    event.component = "mode_manager";
    event.text = "the published pose is being corrected by a large amount";
    event.value = pending_m;
    event.limit = params_.slew.warn_beyond_m;
    observers_->emit(event);
  }
  // Announced once per correction: armed again when it has been worked off.
  warned_ = pending_m > (warned_ ? 0.5 : 1.0) * params_.slew.warn_beyond_m;
}

void ModeManager::force(std::optional<Mode> mode) { forced_ = mode; }

PoseWithCovariance ModeManager::published() const {
  assert(ready());
  PoseWithCovariance pose;
  pose.mean = compose(slewer_.T_map_odom(), T_odom_base_);
  const Pose2& e = slewer_.pending();
  const Eigen::Vector3d error(e.x, e.y, e.phi);
  pose.cov = source_pose_.cov + error * error.transpose();
  return pose;
}

std::optional<PoseWithCovariance> ModeManager::takeSeedRequest() {
  auto request = seed_request_;
  seed_request_.reset();
  return request;
}

}  // namespace vestibule::mode_manager
