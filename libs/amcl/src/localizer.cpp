#include "vestibule/amcl/localizer.hpp"

#include <algorithm>
#include <cmath>

#include "scan_continuity.hpp"

namespace vestibule::amcl {
namespace {

// How well the last fitting pose is still known when a search begins, and how much a place
// elsewhere can lose by it: robots slip more often than they are carried away.
constexpr double kLastPoseSigma_m = 1.0;
constexpr double kLastPoseSigmaPerM = 0.1;
constexpr double kLastPoseSigma_rad = degToRad(20.0);
constexpr double kLastPoseMaxD2 = 6.0;
// The particles begin about a place that was found with at least this spread.
constexpr double kSeedSigma_m = 0.08;
constexpr double kSeedSigma_rad = degToRad(1.5);
// A place found this near to the particles is theirs.
constexpr double kSame_m = 0.3;
constexpr double kSame_rad = degToRad(8.0);
// In doubt, the particles are given up when their place has less than this of the weight.
constexpr double kDoubted = 0.05;
// But not before so many scans have been held against the map: one or two may be blocked.
constexpr int kLooksInDoubt = 5;
// After a jump that may be as much as this: who puts a robot down elsewhere does not ask where it
// fits badly.
constexpr double kDoubtedAfterJump = 0.9;
// A jump: the particles have moved by so much more than the wheels within a little way.
constexpr double kJumpSpan_m = 2.0;
constexpr double kJump_m = 0.4;
constexpr double kJumpPerM = 0.15;
constexpr double kJump_rad = degToRad(20.0);
constexpr double kJumpPerRad = 0.3;
// A search is called off when the particles' place has more than this of the weight.
constexpr double kStillThere = 0.98;
// A scan with a smaller share of beams that end where the map knows something tells nothing.
constexpr double kTellingShare = 0.25;
// A fit of the last metres so much worse than what it was over more of them is no better than a bad
// one: a robot that was carried to where it looks the same drives to where it does not.
constexpr double kRecent_m = 1.0;
constexpr double kUsual_m = 10.0;
constexpr double kDropped = 0.75;
// A pose that only odometry carries on is trusted while it is known this well [one sigma].
constexpr double kCarriedOn_m = 0.5;
constexpr double kCarriedOn_rad = degToRad(10.0);
// Nothing known: the pose is somewhere in a map of this size.
constexpr double kNowhereSigma_m = 100.0;

}  // namespace

struct Localizer::Impl {
  enum class Fit { kGood, kBad, kNone };

  AmclParams params;
  ParticleLocalizer particles;
  GlobalLocalizer global;
  const Observers* observers;
  bool looking = false;    // the search runs
  bool searching = false;  // and the particles' place is no better than what it has found
  bool confirmed = false;  // a scan has fitted since the pose was given
  bool tracking = false;   // the particles have been started, and nothing said to forget them
  std::optional<Pose2> T_map_fitting;  // last fitting pose, carried on by odometry
  double since_fitting_m = 0.0;
  // Where the particles were a little way ago, carried on by odometry.
  Pose2 T_map_carried;
  double carried_m = 0.0;
  double carried_rad = 0.0;
  bool jumped = false;    // since the search began or just before
  bool snatched = false;  // the same: the surroundings changed at once
  ScanContinuity continuity;
  Pose2 T_odom_base;
  // Shares of fitting beams, averaged over the way: of the last metre and of more.
  std::optional<double> recent_share;
  double usual_share = 0.0;
  double since_share_m = 0.0;
  int looks = 0;       // scans that counted in this search
  int misfits = 0;     // used scans in a row that do not fit the particles' pose
  int good_fits = 0;   // and that do, while searching
  bool blind = false;  // the last scan of a search had next to no echo
  int recoveries = 0;
  int searches_before = 0;

  Impl(
      const AmclParams& p,
      const std::shared_ptr<const grid::OccupancyMap>& map,
      std::uint64_t seed,
      const Observers* o)
      : params(p),
        particles(p, map, seed, o),
        global(p.global, map, particles.distances()),
        observers(o) {}

  void startTracking() {
    looking = false;
    jumped = snatched = false;
    searching = false;
    tracking = true;
    misfits = 0;
    good_fits = 0;
  }

  void startLooking(
      const std::optional<grid::PosePrior>& prior,
      const std::optional<grid::SearchWindow>& zone = {}) {
    searches_before += global.searches();
    global.start(prior, zone);
    looking = true;
    looks = 0;
    good_fits = 0;
  }

  [[nodiscard]] std::optional<grid::PosePrior> lastPose() const {
    if (!T_map_fitting) return std::nullopt;
    const double sigma_m = kLastPoseSigma_m + kLastPoseSigmaPerM * since_fitting_m;
    grid::PosePrior prior;
    prior.T_map_base = *T_map_fitting;
    prior.information = Eigen::Vector3d(
                            1.0 / (sigma_m * sigma_m),
                            1.0 / (sigma_m * sigma_m),
                            1.0 / (kLastPoseSigma_rad * kLastPoseSigma_rad))
                            .asDiagonal();
    prior.max_d2 = kLastPoseMaxD2;
    return prior;
  }

  /// The more beams fit, the more may pass through what is mapped: blurred maps are like that.
  [[nodiscard]] bool fits(const Place& place) const {
    const double fitting = place.inlier_share / place.known_share / params.lost_inlier_share;
    return fitting >= 1.0 && place.blocked_share <= params.recovery.max_blocked_share * fitting;
  }

  /// Whether a scan fits the particles' pose, by its ends and by the free space before them. Ends
  /// where the map knows nothing say nothing: a robot may drive where nobody has mapped, and is not
  /// lost there.
  [[nodiscard]] Fit fitOf(const LaserScan& scan, const ScanReport& report) {
    const Place place = global.fitAt(scan, report.T_map_base.mean);
    if (place.known_share < kTellingShare) return Fit::kNone;
    return fits(place) && !dropped(place.inlier_share / place.known_share) ? Fit::kGood : Fit::kBad;
  }

  /// Notes the share of a scan's beams that fit. \return whether it has become much worse
  bool dropped(double share) {
    if (!recent_share) {
      recent_share = share;
      usual_share = share;
    }
    *recent_share += (1.0 - std::exp(-since_share_m / kRecent_m)) * (share - *recent_share);
    usual_share += (1.0 - std::exp(-since_share_m / kUsual_m)) * (share - usual_share);
    since_share_m = 0.0;
    return *recent_share < kDropped * usual_share;
  }

  void startCarrying() {
    T_map_carried = particles.pose().mean;
    carried_m = 0.0;
    carried_rad = 0.0;
  }

  /// Whether the particles have left where the wheels would have taken them.
  [[nodiscard]] bool jumps() {
    const Pose2 off = between(T_map_carried, particles.pose().mean);
    const bool far = translationNorm(off) > kJump_m + kJumpPerM * carried_m ||
                     std::abs(off.phi) > kJump_rad + kJumpPerRad * carried_rad;
    if (far || carried_m > kJumpSpan_m) startCarrying();
    return far;
  }

  [[nodiscard]] static bool knownWell(const Eigen::Matrix3d& cov) {
    return std::sqrt(cov(0, 0) + cov(1, 1)) < kCarriedOn_m && std::sqrt(cov(2, 2)) < kCarriedOn_rad;
  }

  /// What was seen before the robot was carried off says nothing of where it is now, nor does what
  /// was known at the start.
  void noticeCarrying(const LaserScan& scan, const Pose2& T_map_base) {
    if (!continuity.breaks(scan, T_odom_base) || fits(global.fitAt(scan, T_map_base))) return;
    jumped = snatched = true;
    startLooking(std::nullopt);
  }

  /// Also takes for trusted what has only left the mapped part, or sees nothing for a while.
  void watch(const LaserScan& scan, ScanReport& report) {
    if (report.used && jumps()) {
      jumped = true;
      if (!looking) startLooking(lastPose());
    }
    const Fit fit = report.used ? fitOf(scan, report) : Fit::kNone;
    if (fit == Fit::kNone) {
      const bool carried_on = confirmed && misfits == 0 && !searching;
      report.trusted = report.trusted || (carried_on && knownWell(report.T_map_base.cov));
      return;
    }
    if (fit == Fit::kGood) {
      report.trusted = report.trusted || !searching;
      T_map_fitting = particles.pose().mean;
      since_fitting_m = 0.0;
      misfits = 0;
      confirmed = true;
      ++good_fits;
      return;
    }
    good_fits = 0;
    if (looking || ++misfits < params.recovery.after_scans) return;
    startLooking(lastPose());
  }

  /// The particles' place is given up for what the search has found.
  void giveUp(const LaserScan& scan, double inlier_share) {
    searching = true;
    ++recoveries;
    if (observers == nullptr) return;
    WarningEvent event;
    event.stamp = scan.stamp;
    event.component = "amcl";
    event.text = "the scans do not fit the map here, but elsewhere: searching all of it";
    event.value = inlier_share;
    event.limit = params.lost_inlier_share;
    observers->emit(event);
  }

  [[nodiscard]] bool isTracked(const Pose2& T_map_base) const {
    const Pose2 T = particles.pose().mean;
    return distance(T_map_base, T) < kSame_m &&
           std::abs(angleDiff(T_map_base.phi, T.phi)) < kSame_rad;
  }

  /// Says once that a search has nothing to search with; the particles say it of themselves.
  void sayBlind(const LaserScan& scan) {
    constexpr std::size_t kFewest = 10;
    std::size_t valid = 0;
    for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) valid += scan.valid(i) ? 1U : 0U;
    const bool was_blind = blind;
    blind = valid < kFewest;
    if (!blind || was_blind || observers == nullptr) return;
    WarningEvent event;
    event.stamp = scan.stamp;
    event.component = "amcl";
    event.text = "scan not used in the search: too few beams with an echo";
    event.value = static_cast<double>(valid);
    event.limit = static_cast<double>(kFewest);
    observers->emit(event);
  }

  void search(const LaserScan& scan, const ScanReport& report) {
    sayBlind(scan);
    const bool counted = global.process(scan);
    looks += counted ? 1 : 0;
    if (counted && tracking) global.suggest(particles.pose().mean);
    const std::vector<Place> places = global.places();
    if (counted && observers != nullptr) {
      PlacesEvent event;
      event.stamp = scan.stamp;
      event.state = std::string(toString(global.state()));
      for (const Place& p : places) event.places.emplace_back(p.T_map_base.mean, p.weight);
      event.searches = global.searches();
      observers->emit(event);
    }
    const bool fitted = tracking && good_fits >= params.recovery.after_scans;
    const bool same =
        (fitted || !searching) && !places.empty() && isTracked(places.front().T_map_base.mean);
    if (global.state() == PlaceState::kSure) {
      const PoseWithCovariance& found = places.front().T_map_base;
      if (!same) {
        if (!searching) giveUp(scan, report.inlier_share);
        PoseWithCovariance seed = found;
        seed.cov += Eigen::Vector3d(
                        kSeedSigma_m * kSeedSigma_m,
                        kSeedSigma_m * kSeedSigma_m,
                        kSeedSigma_rad * kSeedSigma_rad)
                        .asDiagonal();
        particles.initialise(std::vector<PoseMode>{{seed, 1.0}});
        recent_share.reset();
        startCarrying();
      }
      confirmed = true;
      T_map_fitting = found.mean;
      since_fitting_m = 0.0;
      startTracking();
    } else if (same && global.searches() >= 2 && places.front().weight > kStillThere) {
      // What had hidden the map is gone, and the particles are still where they were right; in an
      // equal room they would fit as well, but would not be the likeliest place.
      startTracking();
    } else if (!searching) {
      // Scans that do not fit are no reason to give up a place when they fit no better elsewhere:
      // the surroundings have changed.
      const double weight = weightOfTracked(places);
      const bool elsewhere = jumped ? weight < kDoubtedAfterJump
                                    : weight < kDoubted && global.state() != PlaceState::kNowhere;
      if (fitted && !jumped) {
        startTracking();
      } else if (looks >= (snatched ? 1 : kLooksInDoubt) && elsewhere) {
        giveUp(scan, report.inlier_share);
      }
    }
  }

  [[nodiscard]] double weightOfTracked(const std::vector<Place>& places) const {
    double weight = 0.0;
    for (const Place& place : places) {
      if (isTracked(place.T_map_base.mean)) weight += place.weight;
    }
    return weight;
  }
};

Localizer::Localizer(
    const AmclParams& params,
    std::shared_ptr<const grid::OccupancyMap> map,
    std::uint64_t seed,
    const Observers* observers)
    : impl_(std::make_unique<Impl>(params, map, seed, observers)) {}

Localizer::~Localizer() = default;

void Localizer::startAt(const PoseWithCovariance& T_map_base) {
  impl_->particles.initialise(T_map_base);
  impl_->T_map_fitting = T_map_base.mean;
  impl_->confirmed = false;
  impl_->since_fitting_m = 0.0;
  impl_->recent_share.reset();
  impl_->continuity.restart();
  impl_->startCarrying();
  impl_->startTracking();
}

void Localizer::startAnywhere(
    const std::optional<grid::PosePrior>& prior, const std::optional<grid::SearchWindow>& zone) {
  impl_->T_map_fitting.reset();
  impl_->tracking = false;
  impl_->misfits = 0;
  impl_->continuity.restart();
  impl_->startLooking(prior, zone);
  impl_->searching = true;
}

void Localizer::process(const WheelOdometry& odometry, YawSource yaw_source) {
  Impl& s = *impl_;
  if (s.tracking) s.particles.process(odometry, yaw_source);
  if (s.looking) s.global.process(odometry);
  if (!isFinite(odometry.T_previous_now)) return;  // the others have said so
  if (s.T_map_fitting) s.T_map_fitting = compose(*s.T_map_fitting, odometry.T_previous_now);
  s.since_fitting_m += translationNorm(odometry.T_previous_now);
  s.T_odom_base = compose(s.T_odom_base, odometry.T_previous_now);
  s.T_map_carried = compose(s.T_map_carried, odometry.T_previous_now);
  s.carried_m += translationNorm(odometry.T_previous_now);
  s.carried_rad += std::abs(odometry.T_previous_now.phi);
  s.since_share_m += translationNorm(odometry.T_previous_now);
}

bool Localizer::learn(PriorKind kind, const grid::PosePrior& prior, const Pose2& T_base_sensor) {
  return impl_->looking && impl_->global.learn(kind, prior, T_base_sensor);
}

void Localizer::process(const Point2& p_map_base, double sigma_m) {
  if (!impl_->searching) impl_->particles.process(p_map_base, sigma_m);
}

ScanReport Localizer::process(const LaserScan& scan) {
  Impl& s = *impl_;
  ScanReport report;
  if (s.tracking) {
    report = s.particles.process(scan);
  }
  s.noticeCarrying(scan, pose().mean);
  if (s.tracking) s.watch(scan, report);
  if (s.looking) {
    s.search(scan, report);
    report.T_map_base = pose();
  }
  if (s.searching) {
    report.trusted = false;
    const std::vector<Place> places = s.global.places();
    report.lost_probability = places.empty() ? 1.0 : 1.0 - places.front().weight;
    if (!s.tracking && !places.empty()) report.inlier_share = places.front().inlier_share;
  }
  if (s.observers != nullptr) {
    PoseEvent event;
    event.stamp = scan.stamp;
    event.source = PoseSource::kParticles;
    event.mode = s.searching || !report.trusted ? Mode::kLost : Mode::kIndoor;
    event.T = report.T_map_base;
    s.observers->emit(event);
  }
  return report;
}

bool Localizer::searching() const { return impl_->searching; }

PlaceState Localizer::state() const {
  return impl_->searching ? impl_->global.state() : PlaceState::kSure;
}

std::vector<Place> Localizer::places() const {
  if (impl_->searching) return impl_->global.places();
  Place place;
  place.T_map_base = impl_->particles.pose();
  place.weight = 1.0;
  place.inlier_share = impl_->particles.lastReport().inlier_share;
  return {place};
}

PoseWithCovariance Localizer::pose() const {
  const Impl& s = *impl_;
  if (!s.searching) return s.particles.pose();
  const std::vector<Place> places = s.global.places();
  if (places.empty()) {
    const Eigen::Matrix3d cov =
        Eigen::Vector3d(kNowhereSigma_m * kNowhereSigma_m, kNowhereSigma_m * kNowhereSigma_m, 10.0)
            .asDiagonal();
    return {s.T_map_fitting.value_or(Pose2{}), cov};
  }
  // A track that has stopped fitting stays the best guess until a place is found: no jumping from
  // candidate to candidate.
  PoseWithCovariance pose{
      s.tracking ? s.particles.pose().mean : places.front().T_map_base.mean,
      Eigen::Matrix3d::Zero()};
  for (const Place& p : places) {
    const Pose2& T = p.T_map_base.mean;
    const Eigen::Vector3d off(
        T.x - pose.mean.x, T.y - pose.mean.y, angleDiff(T.phi, pose.mean.phi));
    pose.cov += p.weight * (p.T_map_base.cov + off * off.transpose());
  }
  return pose;
}

int Localizer::recoveries() const { return impl_->recoveries; }

int Localizer::searches() const { return impl_->searches_before + impl_->global.searches(); }

}  // namespace vestibule::amcl
