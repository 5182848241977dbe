#include "vestibule/amcl/global_localizer.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "scan_fit.hpp"
#include "vestibule/core/parallel.hpp"
#include "vestibule/grid/score_field.hpp"

namespace vestibule::amcl {
namespace {

constexpr std::size_t kEndsPerKey = 90;
constexpr std::size_t kGapsPerKey = 40;
constexpr std::size_t kMinEnds = 12;      // fewer tell nothing
constexpr double kEndSpacing_m = 0.08;    // of the ends kept for the evidence
constexpr double kPointSpacing_m = 0.25;  // of the points that are searched with
// What odometry is good for between two keys, one sigma.
constexpr double kOdometrySigma_m = 0.03;
constexpr double kOdometrySigmaPerM = 0.08;
constexpr double kOdometrySigma_rad = degToRad(1.5);
constexpr double kOdometrySigmaPerRad = 0.10;
// A place this much less likely than the best is forgotten; the next search may find it again.
constexpr double kForgetBelow = 40.0;
constexpr std::size_t kMaxPlaces = 60;
// Points of the last so many metres make up a search: odometry bends longer drives too much.
constexpr double kSearchSpan_m = 3.0;
// Places with a smaller share of inliers are none, of the beams that end where the map knows
// something, and of so many of them at least.
constexpr double kHopelessInliers = 0.3;
constexpr double kLeastKnown = 0.3;
// Where the map knows less than this of what the best place sees, the true one may see even less
// that is known: then ends in unknown cells get a score in the search, too.
constexpr double kWellKnown = 0.85;
constexpr double kUnknownScore = 0.35;
// Shares of fitting beams that differ by less say the same.
constexpr double kFitsAsWell = 0.03;
// A place must be so much more likely when another one fits more of the beams, or when a sensor
// contradicts it: by this share of the most that it can say against a place.
constexpr double kDoubtfulAdvantage = 2.0;
constexpr double kContradicted = 0.7;
// What has been moved misleads for some metres. After a long way that share of the advantage is
// enough, less and less from the first length to the second.
constexpr double kLongWayAdvantage = 0.75;
constexpr double kSomeWay_m = 10.0;
constexpr double kLongWay_m = 15.0;
// Two places nearer than this are one.
constexpr double kSame_m = 0.35;
constexpr double kSame_rad = degToRad(12.0);
// A place is looked for once more within this before it is believed.
constexpr double kAround_m = 1.0;
constexpr double kAround_rad = degToRad(20.0);
// The score that a prior can cost in the search, where it only ranks places.
constexpr double kPriorScorePerNis = 0.002;
// By the way since, what was learnt is known so much worse, one sigma.
constexpr double kLearntSigmaPerM = 0.1;
constexpr double kLearntSigmaPerM_rad = degToRad(1.0);
// And is searched for within so many of them.
constexpr double kLearntSigmas = 2.5;

/// A scan that counts.
struct Key {
  ScanEnds ends;
  std::vector<double> news;  // how much each end adds to what earlier keys have seen
  std::vector<Point2> gaps_base;
  Point2 p_base_laser;
  Pose2 T_odom_base;
};

/// A place with its evidence, key by key.
struct Hypothesis {
  explicit Hypothesis(double surface_m) : missing(surface_m) {}

  PoseWithCovariance T_map_base;  // at the newest key
  std::vector<ScanFit> fits;      // one per key
  Views missing;                  // of squares of mapped surface that should have been seen
  std::vector<double> strain;     // half the squared Mahalanobis distance to odometry, per key
  double log_evidence = 0.0;
  double inlier_share = 0.0;
  double known_share = 0.0;
  double blocked_share = 0.0;
};

/// What a sensor has said on the way.
struct Learnt {
  grid::PosePrior prior;
  Pose2 T_odom_sensor;
  double travelled_m = 0.0;

  /// [1/m^2, 1/m^2, 1/rad^2] about the pose of then, told by odometry's way since.
  [[nodiscard]] Eigen::Matrix3d informationAfter(double way_m) const {
    const Eigen::Array3d sigma(
        kLearntSigmaPerM * way_m, kLearntSigmaPerM * way_m, kLearntSigmaPerM_rad * way_m);
    const Eigen::Array3d kept =
        (1.0 + sigma.square() * prior.information.diagonal().array()).rsqrt();
    return kept.matrix().asDiagonal() * prior.information * kept.matrix().asDiagonal();
  }
};

Eigen::Matrix3d odometryInformation(const Pose2& T_before_after) {
  const double sigma_m = kOdometrySigma_m + kOdometrySigmaPerM * translationNorm(T_before_after);
  const double sigma_rad = kOdometrySigma_rad + kOdometrySigmaPerRad * std::abs(T_before_after.phi);
  return Eigen::Vector3d(
             1.0 / (sigma_m * sigma_m), 1.0 / (sigma_m * sigma_m), 1.0 / (sigma_rad * sigma_rad))
      .asDiagonal();
}

double mahalanobis2(const Pose2& a, const Pose2& b, const Eigen::Matrix3d& information) {
  const Eigen::Vector3d e(a.x - b.x, a.y - b.y, angleDiff(a.phi, b.phi));
  return e.dot(information * e);
}

bool same(const Pose2& a, const Pose2& b) {
  return distance(a, b) < kSame_m && std::abs(angleDiff(a.phi, b.phi)) < kSame_rad;
}

}  // namespace

struct GlobalLocalizer::Impl {
  GlobalParams params;
  std::shared_ptr<const grid::OccupancyMap> map;
  ScanFitter fitter;
  grid::ScoreField field;
  std::optional<grid::ScoreField> lenient_field;  // made when it is first needed
  grid::BaseMask free_space;
  grid::BranchAndBoundMatcher matcher;

  std::optional<grid::PosePrior> prior;             // of the pose at start
  std::map<PriorKind, std::vector<Learnt>> learnt;  // since, oldest first
  std::optional<grid::SearchWindow> zone;           // of the pose at start
  Pose2 T_odom_base;                                // odom: the pose at start
  std::vector<Key> keys;
  Views seen;                          // of surface in odom
  std::vector<Hypothesis> hypotheses;  // best first
  double travelled_m = 0.0;
  double searched_at_m = 0.0;
  double next_search_m = 0.0;  // of travel after the last one
  int searches = 0;
  int counted = 0;  // keys since start

  Impl(
      const GlobalParams& p,
      std::shared_ptr<const grid::OccupancyMap> m,
      std::shared_ptr<const grid::DistanceField> distances)
      : params(p),
        map(std::move(m)),
        fitter(params, *map, std::move(distances)),
        field(scoreField(0.0)),
        free_space(grid::BaseMask::freeSpace(field, *map)),
        matcher(params.search),
        seen(params.surface_m) {}

  [[nodiscard]] grid::ScoreField scoreField(double unknown_score) const {
    return grid::ScoreField::fromDistances(
        *map, fitter.distances(), params.sigma_m, params.cell_m, params.max_range_m, unknown_score);
  }

  [[nodiscard]] ScanEnds endsOf(const LaserScan& scan) const {
    return spreadEnds(scan, params.max_range_m, kEndSpacing_m, kEndsPerKey, params.small_m);
  }

  void addKey(const LaserScan& scan, ScanEnds ends) {
    if (keys.size() == static_cast<std::size_t>(params.max_keys)) {
      keys.erase(keys.begin());
      for (Hypothesis& h : hypotheses) {
        h.fits.erase(h.fits.begin());
        h.strain.erase(h.strain.begin());
      }
    }
    const Pose2 step = keys.empty() ? Pose2{} : between(keys.back().T_odom_base, T_odom_base);
    std::vector<double> news;
    for (std::size_t i = 0; i < ends.p_base.size(); ++i) {
      const Point2 p = transform(T_odom_base, ends.p_base[i]);
      news.push_back(
          (ends.follows[i] != 0 ? seen.newsOf(transform(T_odom_base, ends.p_base[i - 1]), p)
                                : seen.newsOf(p)) *
          (ends.stand_out[i] != 0 ? params.movable_share : 1.0));
    }
    keys.push_back(
        {std::move(ends),
         std::move(news),
         spreadGaps(scan, params.max_range_m, kGapsPerKey),
         {scan.T_base_laser.x, scan.T_base_laser.y},
         T_odom_base});
    ++counted;
    parallelFor(hypotheses.size(), threadCount(params.search.threads), [&](std::size_t i) {
      extend(hypotheses[i], step);
    });
  }

  /// One more key at the newer end.
  void extend(Hypothesis& h, const Pose2& step) const {
    const Pose2 predicted = compose(h.T_map_base.mean, step);
    hold(h, keys.size() - 1, predicted, odometryInformation(step), true);
  }

  [[nodiscard]] ScanFit fitAt(const Key& key, const Pose2& T_map_base, Views& missing) const {
    return fitter.fit(key.ends, key.news, key.gaps_base, key.p_base_laser, T_map_base, missing);
  }

  /// Refines the pose of one key about where odometry puts it and notes the evidence.
  Pose2 hold(
      Hypothesis& h,
      std::size_t key,
      const Pose2& predicted,
      const Eigen::Matrix3d& information,
      bool newest) const {
    const Key& k = keys[key];
    const PoseWithCovariance T = fitter.refined(k.ends, predicted, information);
    const ScanFit fit = fitAt(k, T.mean, h.missing);
    const double strain = 0.5 * mahalanobis2(T.mean, predicted, information);
    if (newest) {
      h.T_map_base = T;
      h.fits.push_back(fit);
      h.strain.push_back(strain);
    } else {
      h.fits[key] = fit;
      h.strain[key] = strain;
    }
    return T.mean;
  }

  /// A place found just now, held against all keys from the newest to the oldest.
  [[nodiscard]] Hypothesis judged(const Pose2& T_map_base) const {
    Hypothesis h(params.surface_m);
    h.fits.resize(keys.size());
    h.strain.resize(keys.size());
    const std::size_t newest = keys.size() - 1;
    // Found on a lattice: the scan alone says where exactly.
    const PoseWithCovariance T =
        fitter.refined(keys[newest].ends, T_map_base, Eigen::Matrix3d::Zero());
    Pose2 T_here = T.mean;
    // A refinement that leads away from the place has found another one; keep to the place.
    if (!same(T_here, T_map_base)) T_here = T_map_base;
    h.T_map_base = {T_here, T.cov};
    h.fits[newest] = fitAt(keys[newest], T_here, h.missing);
    for (std::size_t key = newest; key-- > 0;) {
      const Pose2 back = between(keys[key + 1].T_odom_base, keys[key].T_odom_base);
      T_here = hold(h, key, compose(T_here, back), odometryInformation(back), false);
    }
    return h;
  }

  /// Points of what the last keys saw, in the present base frame, spread evenly.
  [[nodiscard]] std::vector<Point2> searchPoints() const {
    std::vector<Point2> spread;
    std::set<std::pair<long, long>> taken;
    double back_m = 0.0;
    for (std::size_t key = keys.size(); key-- > 0 && back_m < kSearchSpan_m;) {
      if (key + 1 < keys.size())
        back_m += distance(keys[key].T_odom_base, keys[key + 1].T_odom_base);
      const Pose2 T_base_key = between(T_odom_base, keys[key].T_odom_base);
      for (const Point2& end : keys[key].ends.p_base) {
        const Point2 p = transform(T_base_key, end);
        if (std::hypot(p.x, p.y) > params.max_range_m) continue;
        const std::pair<long, long> cell{
            std::lround(p.x / kPointSpacing_m), std::lround(p.y / kPointSpacing_m)};
        if (taken.insert(cell).second) spread.push_back(p);
      }
    }
    const auto n = static_cast<std::size_t>(params.points);
    if (spread.size() <= n) return spread;
    std::vector<Point2> chosen;
    for (std::size_t i = 0; i < n; ++i) chosen.push_back(spread[i * spread.size() / n]);
    return chosen;
  }

  /// The zone, widened by the way driven since.
  [[nodiscard]] grid::SearchWindow window() const {
    if (!zone) return grid::wholeField(field);
    grid::SearchWindow window = *zone;
    window.T_map_centre.phi = wrapToPi(window.T_map_centre.phi + T_odom_base.phi);
    window.half_x_m += travelled_m;
    window.half_y_m += travelled_m;
    return window;
  }

  /// What was learnt last, of the present pose. A position may by now lie anywhere within the way
  /// since, for nothing tells in which direction the robot went.
  [[nodiscard]] std::optional<grid::PosePrior> learntNow() const {
    if (learnt.empty()) return std::nullopt;
    grid::PosePrior now;
    now.max_d2 = 0.0;
    for (const auto& [kind, readings] : learnt) {
      const Learnt& l = readings.back();
      now.max_d2 = std::max(now.max_d2, l.prior.max_d2);
      if (kind == PriorKind::kHeading) {
        now.T_map_base.phi =
            wrapToPi(l.prior.T_map_base.phi + T_odom_base.phi - l.T_odom_sensor.phi);
        now.information(2, 2) = l.informationAfter(travelled_m - l.travelled_m)(2, 2);
      } else {
        now.T_map_base.x = l.prior.T_map_base.x;
        now.T_map_base.y = l.prior.T_map_base.y;
        const double off_m = travelled_m - l.travelled_m + distance(l.T_odom_sensor, T_odom_base);
        const double information = l.prior.information(0, 0);
        now.information(0, 0) = now.information(1, 1) =
            information / (1.0 + off_m * off_m * information);
      }
    }
    return now;
  }

  /// Where what was learnt says that the robot is.
  [[nodiscard]] grid::SearchWindow windowAbout(const grid::PosePrior& now) const {
    grid::SearchWindow window = grid::wholeField(field);
    if (now.information(0, 0) > 0.0) {
      window.T_map_centre.x = now.T_map_base.x;
      window.T_map_centre.y = now.T_map_base.y;
      window.half_x_m = window.half_y_m = kLearntSigmas / std::sqrt(now.information(0, 0));
    }
    if (now.information(2, 2) > 0.0) {
      window.T_map_centre.phi = now.T_map_base.phi;
      window.half_yaw_rad = std::min(kPi, kLearntSigmas / std::sqrt(now.information(2, 2)));
    }
    return window;
  }

  void search() {
    ++searches;
    searched_at_m = travelled_m;
    next_search_m =
        searches == 1 ? params.first_search_m : std::min(2.0 * next_search_m, params.max_search_m);
    const std::optional<grid::PosePrior> now = learntNow();
    // The prior of the start ranks the places while it speaks of the same pose.
    std::optional<grid::PosePrior> ranking = prior && travelled_m == 0.0 ? prior : now;
    if (ranking) ranking->weight = kPriorScorePerNis;
    std::vector<grid::SearchWindow> windows{window()};
    // Places that fit worse than those elsewhere are no matches there, but may be the best here.
    if (now && !zone) windows.push_back(windowAbout(*now));
    const std::vector<Point2> points = searchPoints();
    const auto searchIn = [&](const grid::ScoreField& scores) {
      for (const grid::SearchWindow& w : windows) {
        add(matcher.match(scores, points, w, &free_space, ranking));
      }
      rank();
    };
    searchIn(field);
    if (hypotheses.empty() || hypotheses.front().known_share < kWellKnown) {
      if (!lenient_field) lenient_field = scoreField(kUnknownScore);
      searchIn(*lenient_field);
    }
  }

  /// Looks again about the best place: in drawing on from key to key it may have come off.
  void searchAroundBest() {
    const Pose2 T_map_best = hypotheses.front().T_map_base.mean;
    add(matcher.match(
        field, searchPoints(), {T_map_best, kAround_m, kAround_m, kAround_rad}, &free_space));
  }

  void add(const std::vector<grid::PoseMatch>& found) {
    std::vector<Hypothesis> fresh(found.size(), Hypothesis(params.surface_m));
    parallelFor(found.size(), threadCount(params.search.threads), [&](std::size_t i) {
      fresh[i] = judged(found[i].T_map_base);
    });
    for (Hypothesis& h : fresh) hypotheses.push_back(std::move(h));
  }

  /// What small things say against a place: each at most that it has been moved.
  [[nodiscard]] double ofThings(const Hypothesis& h) const {
    std::map<std::int64_t, double> sums;
    for (const ScanFit& fit : h.fits) {
      for (const ThingEvidence& e : fit.things) sums[e.thing] += e.log_likelihood;
    }
    double sum = 0.0;
    for (const auto& [thing, log_likelihood] : sums) {
      sum += std::log(params.moved_share + (1.0 - params.moved_share) * std::exp(log_likelihood));
    }
    return sum;
  }

  /// Squared Mahalanobis distance of a place to what a sensor has said: the mean over its readings,
  /// for they err alike and are one opinion, and of sharp ones before blunt ones.
  [[nodiscard]] double strainOf(
      const std::vector<Learnt>& readings, const Pose2& T_map_start) const {
    double sum = 0.0;
    double weight = 0.0;
    for (const Learnt& l : readings) {
      const Eigen::Matrix3d information = l.informationAfter(travelled_m - l.travelled_m);
      const double d2 =
          mahalanobis2(compose(T_map_start, l.T_odom_sensor), l.prior.T_map_base, information);
      sum += information.trace() * std::min(d2, l.prior.max_d2);
      weight += information.trace();
    }
    return weight > 0.0 ? sum / weight : 0.0;
  }

  /// Sums the evidence, best first; what is a double of a better one or hopeless goes.
  void rank() {
    for (Hypothesis& h : hypotheses) {
      h.log_evidence = ofThings(h);
      h.inlier_share = h.known_share = h.blocked_share = 0.0;
      const auto n = static_cast<double>(h.fits.size());
      for (std::size_t k = 0; k < h.fits.size(); ++k) {
        h.log_evidence += h.fits[k].log_likelihood - h.strain[k];
        h.inlier_share += h.fits[k].inlier_share / n;
        h.known_share += h.fits[k].known_share / n;
        h.blocked_share += h.fits[k].blocked_share / n;
      }
      if (prior) {
        h.log_evidence -= 0.5 * std::min(
                                    mahalanobis2(atStart(h), prior->T_map_base, prior->information),
                                    prior->max_d2);
      }
      for (const auto& [kind, all] : learnt) h.log_evidence -= 0.5 * strainOf(all, atStart(h));
    }
    std::stable_sort(
        hypotheses.begin(), hypotheses.end(), [](const Hypothesis& a, const Hypothesis& b) {
          return a.log_evidence > b.log_evidence;
        });
    std::vector<Hypothesis> kept;
    for (Hypothesis& h : hypotheses) {
      if (kept.size() == kMaxPlaces) break;
      if (h.inlier_share < kHopelessInliers * std::max(h.known_share, kLeastKnown)) continue;
      if (!kept.empty() && h.log_evidence < kept.front().log_evidence - kForgetBelow) break;
      const bool is_double = std::any_of(kept.begin(), kept.end(), [&](const Hypothesis& other) {
        return same(other.T_map_base.mean, h.T_map_base.mean);
      });
      if (!is_double) kept.push_back(std::move(h));
    }
    hypotheses = std::move(kept);
  }

  /// A place at the present odometry.
  [[nodiscard]] PoseWithCovariance here(const Hypothesis& h) const {
    return compose(h.T_map_base, between(keys.back().T_odom_base, T_odom_base));
  }

  /// And where it puts the robot at start.
  [[nodiscard]] Pose2 atStart(const Hypothesis& h) const {
    return compose(h.T_map_base.mean, inverse(keys.back().T_odom_base));
  }

  [[nodiscard]] bool fits(const Hypothesis& h) const {
    return h.inlier_share >= params.min_inlier_share && h.blocked_share <= params.max_blocked_share;
  }

  /// Whether no other place fits more of the beams.
  [[nodiscard]] bool fitsBest(const Hypothesis& h) const {
    return std::all_of(hypotheses.begin(), hypotheses.end(), [&](const Hypothesis& other) {
      return other.inlier_share - other.blocked_share <=
             h.inlier_share - h.blocked_share + kFitsAsWell;
    });
  }

  [[nodiscard]] bool contradicted(const Hypothesis& h) const {
    return std::any_of(learnt.begin(), learnt.end(), [&](const auto& of_kind) {
      const std::vector<Learnt>& readings = of_kind.second;
      return strainOf(readings, atStart(h)) > kContradicted * readings.back().prior.max_d2;
    });
  }

  /// Log odds of the best place against all others.
  [[nodiscard]] double advantage() const {
    double others = 0.0;
    for (std::size_t i = 1; i < hypotheses.size(); ++i) {
      others += std::exp(hypotheses[i].log_evidence - hypotheses.front().log_evidence);
    }
    return others > 0.0 ? -std::log(others) : std::numeric_limits<double>::infinity();
  }

  [[nodiscard]] PlaceState state() const {
    if (hypotheses.empty() || !fits(hypotheses.front())) return PlaceState::kNowhere;
    const bool seen_enough =
        counted >= params.min_keys && travelled_m >= params.min_travel_m && searches >= 2;
    const bool doubtful = !fitsBest(hypotheses.front()) || contradicted(hypotheses.front());
    const double long_way =
        std::clamp((travelled_m - kSomeWay_m) / (kLongWay_m - kSomeWay_m), 0.0, 1.0);
    const double needed = params.min_advantage * (doubtful ? kDoubtfulAdvantage : 1.0) *
                          (1.0 + long_way * (kLongWayAdvantage - 1.0));
    return seen_enough && advantage() >= needed ? PlaceState::kSure : PlaceState::kUnsure;
  }
};

GlobalLocalizer::GlobalLocalizer(
    const GlobalParams& params,
    std::shared_ptr<const grid::OccupancyMap> map,
    std::shared_ptr<const grid::DistanceField> distances)
    : impl_(std::make_unique<Impl>(params, std::move(map), std::move(distances))) {}

GlobalLocalizer::~GlobalLocalizer() = default;

void GlobalLocalizer::start(
    const std::optional<grid::PosePrior>& prior, const std::optional<grid::SearchWindow>& zone) {
  impl_->prior = prior;
  impl_->learnt.clear();
  impl_->zone = zone;
  impl_->T_odom_base = {};
  impl_->keys.clear();
  impl_->seen.clear();
  impl_->hypotheses.clear();
  impl_->travelled_m = 0.0;
  impl_->searches = 0;
  impl_->counted = 0;
}

bool GlobalLocalizer::learn(
    PriorKind kind, const grid::PosePrior& prior, const Pose2& T_base_sensor) {
  Impl& s = *impl_;
  if (!isFinite(prior.T_map_base) || !prior.information.allFinite() || !isFinite(T_base_sensor)) {
    return false;
  }
  const Learnt now{prior, compose(s.T_odom_base, T_base_sensor), s.travelled_m};
  std::vector<Learnt>& readings = s.learnt[kind];
  const auto placeOf = [&](const Learnt& l) {
    return std::floor(l.travelled_m / s.params.key_distance_m);
  };
  if (!readings.empty() && placeOf(readings.back()) == placeOf(now)) {
    if (readings.back().prior.information.trace() > prior.information.trace()) return false;
    readings.back() = now;
    return true;
  }
  if (readings.size() == static_cast<std::size_t>(s.params.max_keys)) {
    readings.erase(readings.begin());
  }
  readings.push_back(now);
  return true;
}

void GlobalLocalizer::process(const WheelOdometry& odometry) {
  Impl& s = *impl_;
  if (!isFinite(odometry.T_previous_now)) return;
  s.T_odom_base = compose(s.T_odom_base, odometry.T_previous_now);
  s.travelled_m += translationNorm(odometry.T_previous_now);
}

bool GlobalLocalizer::process(const LaserScan& scan) {
  Impl& s = *impl_;
  if (!isFinite(scan.T_base_laser)) return false;
  if (!s.keys.empty()) {
    const Pose2 step = between(s.keys.back().T_odom_base, s.T_odom_base);
    if (translationNorm(step) < s.params.key_distance_m &&
        std::abs(step.phi) < s.params.key_turn_rad) {
      return false;
    }
  }
  ScanEnds ends = s.endsOf(scan);
  if (ends.p_base.size() < kMinEnds) return false;
  s.addKey(scan, std::move(ends));
  s.rank();
  const double wait_m =
      s.state() == PlaceState::kNowhere ? s.params.first_search_m : s.next_search_m;
  const bool due = s.searches == 0 || s.travelled_m - s.searched_at_m >= wait_m;
  if (due && s.state() != PlaceState::kSure) {
    s.search();
  }
  // The true place may have come into reach of the search only now.
  if (s.state() == PlaceState::kSure &&
      s.travelled_m - s.searched_at_m >= s.params.first_search_m) {
    s.search();
  }
  if (s.state() == PlaceState::kSure) {
    s.searchAroundBest();
    s.rank();
  }
  return true;
}

void GlobalLocalizer::suggest(const Pose2& T_map_base) {
  Impl& s = *impl_;
  if (s.keys.empty()) return;
  const bool known =
      std::any_of(s.hypotheses.begin(), s.hypotheses.end(), [&](const Hypothesis& h) {
        return same(s.here(h).mean, T_map_base);
      });
  if (known) return;
  s.hypotheses.push_back(
      s.judged(compose(T_map_base, between(s.T_odom_base, s.keys.back().T_odom_base))));
  s.rank();
}

PlaceState GlobalLocalizer::state() const { return impl_->state(); }

std::vector<Place> GlobalLocalizer::places() const {
  std::vector<Place> places;
  if (impl_->hypotheses.empty()) return places;
  const double best = impl_->hypotheses.front().log_evidence;
  double sum = 0.0;
  for (const Hypothesis& h : impl_->hypotheses) {
    places.push_back(
        {impl_->here(h), std::exp(h.log_evidence - best), h.inlier_share, h.blocked_share, 1.0});
    sum += places.back().weight;
  }
  for (Place& place : places) place.weight /= sum;
  return places;
}

Place GlobalLocalizer::fitAt(const LaserScan& scan, const Pose2& T_map_base) const {
  Views missing(impl_->params.surface_m);
  const ScanFit fit = impl_->fitter.fit(
      impl_->endsOf(scan), {}, {}, {scan.T_base_laser.x, scan.T_base_laser.y}, T_map_base, missing);
  return {
      {T_map_base, Eigen::Matrix3d::Zero()},
      1.0,
      fit.inlier_share,
      fit.blocked_share,
      fit.known_share};
}

double GlobalLocalizer::travelled() const { return impl_->travelled_m; }

int GlobalLocalizer::searches() const { return impl_->searches; }

const grid::OccupancyMap& GlobalLocalizer::map() const { return *impl_->map; }

std::string_view toString(PlaceState state) {
  switch (state) {
    case PlaceState::kNowhere:
      return "nowhere";
    case PlaceState::kUnsure:
      return "unsure";
    case PlaceState::kSure:
      break;
  }
  return "sure";
}

void describe(ParamIo& io, GlobalParams& p) {
  io.section("search", p.search);
  io.optional("cell_m", p.cell_m, positive());
  io.optional("sigma_m", p.sigma_m, positive());
  io.optional("max_range_m", p.max_range_m, positive());
  io.optional("points", p.points, within(20, 256));
  io.optional("key_distance_m", p.key_distance_m, positive());
  io.optionalDegrees("key_turn_deg", p.key_turn_rad, positive());
  io.optional("max_keys", p.max_keys, within(2, 1000));
  io.optional("sigma_hit_m", p.sigma_hit_m, positive());
  io.optional("random_share", p.random_share, inside(0.0, 1.0));
  io.optional("blocked_share", p.blocked_share, inside(0.0, 1.0));
  io.optional("no_echo_share", p.no_echo_share, inside(0.0, 1.0));
  io.optional("surface_m", p.surface_m, positive());
  io.optional("surface_share", p.surface_share, within(0.0, 1.0));
  io.optional("small_m", p.small_m, nonNegative());
  io.optional("movable_share", p.movable_share, within(0.0, 1.0));
  io.optional("moved_share", p.moved_share, inside(0.0, 1.0));
  io.optional("inlier_distance_m", p.inlier_distance_m, positive());
  io.optional("min_travel_m", p.min_travel_m, nonNegative());
  io.optional("min_keys", p.min_keys, within(1, 1000));
  io.optional("min_inlier_share", p.min_inlier_share, within(0.0, 1.0));
  io.optional("max_blocked_share", p.max_blocked_share, within(0.0, 1.0));
  io.optional("min_advantage", p.min_advantage, nonNegative());
  io.optional("first_search_m", p.first_search_m, positive());
  io.optional("max_search_m", p.max_search_m, positive());
}

}  // namespace vestibule::amcl
