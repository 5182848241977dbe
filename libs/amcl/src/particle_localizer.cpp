#include "vestibule/amcl/particle_localizer.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>

#include "clusters.hpp"
#include "likelihood_table.hpp"
#include "motion_model.hpp"
#include "odometry_track.hpp"
#include "particle_set.hpp"
#include "refinement.hpp"
#include "scan_beams.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::amcl {
namespace {

constexpr std::size_t kMinBeams = 10;
constexpr int kEvidenceBeams = 90;
constexpr double kFar_m = 1e3;
constexpr double kBlockedMargin_m = 0.4;  // beams end about here before the obstacle they hit
constexpr double kOldScan_s = 10.0;       // stamps farther back are another clock's
constexpr double kNoOdometry_s = 2.0;
constexpr double kSlowEvidence_s = 10.0;
constexpr double kAgreeing_m = 0.25;  // between a beam and what the map says it meets
constexpr double kSharp_m = 0.1;
constexpr double kMemory_m = 30.0;  // driven, after which a contradiction is forgotten
constexpr double kConvergedSpread_m = 1.5;
constexpr double kSearchTempering = 0.5;
constexpr double kClusterBin_m = 0.5;
constexpr double kClusterBin_rad = degToRad(15.0);
constexpr double kClusterShare = 0.02;  ///< places with less of the weight are not worth a word
// The particles' place replaces the refined track when the two exclude each other (chi-square of
// three degrees of freedom, 0.1 %) and the scan fits it better by this much [log].
constexpr double kOtherPlaceChi2 = 16.27;
constexpr double kOtherPlaceMargin = 1.0;

constexpr double kSurprisingChi2 = 9.49;      // chi-square of four degrees of freedom, 5 %
constexpr double kSlipCost = 4.6;             // slips happen in one of a hundred updates
constexpr double kMisfit = 0.8;               // share of the usual fitting share
constexpr double kSearchMargin = 2.0;         // [log]
constexpr double kWallOffsetWalk_m = 0.0005;  // its change from update to update

enum NoisePurpose : std::uint32_t { kMotionNoise = 1, kKernelNoise = 2 };

/// A pose that takes many points along: its sine and cosine are computed once.
class Turned {
 public:
  explicit Turned(const Pose2& T) : T_(T), c_(std::cos(T.phi)), s_(std::sin(T.phi)) {}
  [[nodiscard]] Point2 operator()(const Point2& p) const {
    return {T_.x + c_ * p.x - s_ * p.y, T_.y + s_ * p.x + c_ * p.y};
  }

 private:
  Pose2 T_;
  double c_;
  double s_;
};

Eigen::Matrix3d rotation(double yaw) {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  R(0, 0) = R(1, 1) = std::cos(yaw);
  R(1, 0) = std::sin(yaw);
  R(0, 1) = -R(1, 0);
  return R;
}

/// T_a_c with both covariances; that of `step` is in b's axes about c.
PoseWithCovariance composeBoth(const PoseWithCovariance& T_a_b, const PoseWithCovariance& step) {
  PoseWithCovariance result = compose(T_a_b, step.mean);
  const Eigen::Matrix3d R = rotation(T_a_b.mean.phi);
  result.cov += R * step.cov * R.transpose();
  return result;
}

/// The free cells of a map by their number among them, without a list of all of them.
class FreeCells {
 public:
  explicit FreeCells(const grid::OccupancyMap& map) : map_(map) {
    const std::size_t cells = cellCount();
    free_before_.reserve(cells / kBlock + 2);
    for (std::size_t cell = 0; cell < cells; ++cell) {
      if (cell % kBlock == 0) free_before_.push_back(size_);
      if (isFree(cell)) ++size_;
    }
  }

  [[nodiscard]] std::size_t size() const { return size_; }
  /// \pre k < size(). The cell's place in the map, row by row.
  [[nodiscard]] std::size_t operator[](std::size_t k) const {
    const auto after = std::upper_bound(free_before_.begin(), free_before_.end(), k);
    const auto block = static_cast<std::size_t>(after - free_before_.begin()) - 1;
    std::size_t cell = block * kBlock;
    for (std::size_t seen = free_before_[block];; ++cell) {
      if (isFree(cell) && seen++ == k) return cell;
    }
  }

 private:
  static constexpr std::size_t kBlock = 64;

  [[nodiscard]] std::size_t cellCount() const {
    return static_cast<std::size_t>(map_.width()) * static_cast<std::size_t>(map_.height());
  }
  [[nodiscard]] bool isFree(std::size_t cell) const {
    const auto width = static_cast<std::size_t>(map_.width());
    return map_.cell(static_cast<int>(cell % width), static_cast<int>(cell / width)) ==
           grid::Cell::kFree;
  }

  const grid::OccupancyMap& map_;
  std::size_t size_ = 0;
  std::vector<std::size_t> free_before_;  // each block of cells
};

/// The map, if there is anything in it to localize by.
std::shared_ptr<const grid::OccupancyMap> usable(std::shared_ptr<const grid::OccupancyMap> map) {
  requireUsable(*map, "the map");
  return map;
}

double mahalanobis2(const Pose2& a, const Pose2& b, const Eigen::Matrix3d& cov) {
  const Eigen::Vector3d d(a.x - b.x, a.y - b.y, angleDiff(a.phi, b.phi));
  return d.dot(cov.ldlt().solve(d));
}

}  // namespace

void requireUsable(const grid::OccupancyMap& map, const std::string& name) {
  if (map.count(grid::Cell::kFree) == 0) {
    throw InputError(
        name +
        ": no free cell, so the robot cannot be anywhere in it; check its image, thresholds and "
        "negate");
  }
  if (map.count(grid::Cell::kOccupied) == 0) {
    throw InputError(
        name +
        ": no occupied cell, so scans say nothing in it; check its image, thresholds and negate");
  }
}

double inlierShare(
    const LaserScan& scan,
    const Pose2& T_map_base,
    const grid::DistanceField& field,
    double inlier_distance_m,
    double max_range_m) {
  const Pose2 T_grid_laser = compose(field.T_grid_map(), compose(T_map_base, scan.T_base_laser));
  std::size_t valid = 0;
  std::size_t inliers = 0;
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const auto range = static_cast<double>(scan.ranges_m[i]);
    if (!scan.valid(i) || range > max_range_m) continue;
    ++valid;
    const double angle = T_grid_laser.phi + scan.angle(i);
    const Point2 end{
        T_grid_laser.x + range * std::cos(angle), T_grid_laser.y + range * std::sin(angle)};
    if (field.atGrid(end, max_range_m) < inlier_distance_m) ++inliers;
  }
  if (valid < kMinBeams) return 0.0;
  return static_cast<double>(inliers) / static_cast<double>(valid);
}

struct ParticleLocalizer::Impl {
  AmclParams params;
  std::shared_ptr<const grid::OccupancyMap> map;
  std::shared_ptr<const grid::DistanceField> distances;
  const grid::DistanceField& field;
  LikelihoodTable table;
  std::uint64_t seed;
  const Observers* observers;

  ParticleSet particles;
  mrpt::bayes::CParticleFilter driver;
  bool initialised = false;
  bool first_scan = true;  // the first scan after initialising is always used
  Timestamp last_update;
  Timestamp last_scan;
  Pose2 T_odom_last_scan;

  OdometryTrack odometry;
  Pose2 T_odom_update;       // where the odometry was at the last used scan
  double travelled_m = 0.0;  // since then
  double turned_rad = 0.0;
  double gyro_rad = 0.0;
  double timing_var_m2 = 0.0;  // of T_odom_update

  std::optional<Timestamp> last_odometry;
  std::optional<Timestamp> start_stamp;  // of the odometry when the particles were drawn
  std::string last_refusal;
  std::optional<Timestamp> first_scan_stamp;
  bool odometry_missing = false;
  std::vector<Point2> p_map_unmapped;  // of the last scan

  bool tracking = false;              // `estimate` is refined; otherwise it sums up the particles
  PoseWithCovariance estimate;        // T_grid_base at the last used scan
  std::vector<Clusters::One> places;  // at the last used scan, not refined
  double residual_sigma_m;
  LearntOfMap learnt;
  Eigen::Vector3d wall_offset_cov = Eigen::Vector3d::Zero();  // of the offset with the tracked pose
  LostEvidence evidence;                                      // of the last scan alone
  double fitting_share = 0.0;                                 // of the last refinement
  double usual_fitting_share = 0.0;                           // its running mean; 0 = none yet
  ScanReport report;

  Impl(
      const AmclParams& p,
      std::shared_ptr<const grid::OccupancyMap> m,
      std::uint64_t s,
      const Observers* o,
      const LearntOfMap& l)
      : params(p),
        map(usable(std::move(m))),
        distances(std::make_shared<const grid::DistanceField>(*map)),
        field(*distances),
        table(*map, field, params.field),
        seed(s),
        observers(o),
        particles(table, params.threads),
        residual_sigma_m(params.field.sigma_hit_m),
        learnt(l) {
    driver.m_options.PF_algorithm = mrpt::bayes::CParticleFilter::pfStandardProposal;
    driver.m_options.adaptiveSampleSize = true;  // resampling is ours: MRPT's draws differently
    particles.keepEffective(params.resampling.min_effective_share);
  }

  [[nodiscard]] NoiseKey noiseKey(NoisePurpose purpose) {
    NoiseKey key;
    const std::uint64_t hashed = derivedSeed(seed, "amcl");
    key.seed = {static_cast<std::uint32_t>(hashed), static_cast<std::uint32_t>(hashed >> 32U)};
    key.purpose = purpose;
    key.step = learnt.draws++;
    return key;
  }
  [[nodiscard]] RandomStream stream(const char* name) { return {seed, name, learnt.draws++}; }

  void restart() {
    initialised = true;
    first_scan = true;
    tracking = false;
    start_stamp = last_odometry;
    evidence = {};
    T_odom_update = odometry.now();
    timing_var_m2 = odometry.timingVar_m2();
    travelled_m = turned_rad = gyro_rad = 0.0;
    residual_sigma_m = params.field.sigma_hit_m;
    wall_offset_cov.setZero();
    usual_fitting_share = 0.0;
    report = {};
    particles.normalizeWeights();
    summarise();
  }

  /// Finds the places the particles stand for; the estimate is the best of them.
  void summarise() {
    estimate = particles.moments();
    places.clear();
    if (spread() <= kConvergedSpread_m) {
      places.push_back({1.0, estimate});
      return;
    }
    places = findClusters(particles, kClusterBin_m, kClusterBin_rad).clusters;
    const Pose2 all = estimate.mean;
    estimate.mean = places.front().T_grid_base.mean;
    // The covariance stays that of all particles, about the best place.
    const Eigen::Vector3d d(
        estimate.mean.x - all.x, estimate.mean.y - all.y, angleDiff(estimate.mean.phi, all.phi));
    if (places.front().weight > 1.0 - kClusterShare) {
      estimate = places.front().T_grid_base;
    } else {
      estimate.cov += d * d.transpose();
    }
  }

  [[nodiscard]] double spread() const { return std::sqrt(estimate.cov(0, 0) + estimate.cov(1, 1)); }

  [[nodiscard]] PoseWithCovariance carriedTo(const Pose2& T_odom_base) const {
    Motion motion;
    motion.T_from_to = between(T_odom_update, T_odom_base);
    motion.travelled_m = translationNorm(motion.T_from_to);
    motion.turned_rad = std::abs(motion.T_from_to.phi);
    motion.gyro_rad = turned_rad > 0.0 ? motion.turned_rad * gyro_rad / turned_rad : 0.0;
    motion.timing_m = timingSigma();
    MotionNoise noise = params.motion;
    noise.min_trans_m = 0.0;
    noise.min_rot_rad = 0.0;
    PoseWithCovariance T = composeBoth(estimate, likelyMotion(motion, noise));
    const double map_m2 = params.refinement.map_sigma_m * params.refinement.map_sigma_m;
    const double map_rad2 = params.refinement.map_sigma_rad * params.refinement.map_sigma_rad;
    T.cov += Eigen::Vector3d(map_m2, map_m2, map_rad2).asDiagonal();
    return compose(map->T_map_grid(), T);
  }

  /// One sigma, along the way since the last update, of when its odometry was read [m].
  [[nodiscard]] double timingSigma() const {
    return travelled_m > 0.0 ? std::sqrt(timing_var_m2 + odometry.timingVar_m2()) : 0.0;
  }

  /// What the odometry says of the way since the last update.
  [[nodiscard]] Motion motionTo(const Pose2& T_odom_scan) const {
    return {between(T_odom_update, T_odom_scan), travelled_m, turned_rad, gyro_rad, timingSigma()};
  }

  /// Whether the scan contradicts where the odometry led the tracked pose.
  [[nodiscard]] bool surprises(
      const LaserScan& scan, const std::vector<Point2>& all_ends, const Pose2& T_odom_scan) const {
    if (!tracking) return false;
    const PoseWithCovariance step = likelyMotion(motionTo(T_odom_scan), params.motion);
    const TrackState prior = trackState(composeBoth(estimate, step), wall_offset_cov);
    const Refinement test = refine(
        field,
        spreadAlongContour(all_ends, 0.0, params.field.max_beams),
        {scan.T_base_laser.x, scan.T_base_laser.y},
        prior,
        prior.T_grid_base,
        residual_sigma_m,
        params.refinement);
    return test.correction_chi2 > kSurprisingChi2;
  }

  /// One sigma of the direction the scan says least about [m].
  [[nodiscard]] static double weakestSigma(const Eigen::Matrix3d& information) {
    constexpr double kLargest_m = 1.0;
    const double a = information(0, 0);
    const double b = information(0, 1);
    const double c = information(1, 1);
    const double smallest = 0.5 * (a + c) - std::hypot(0.5 * (a - c), b);
    return smallest > 1.0 / (kLargest_m * kLargest_m) ? 1.0 / std::sqrt(smallest) : kLargest_m;
  }

  /// What the scan says at the estimated pose; fills p_map_unmapped.
  void collectEvidence(const std::vector<Point2>& ends, const Point2& p_base_laser) {
    const Turned T_grid_base(compose(inverse(map->T_map_grid()), report.T_map_base.mean));
    const Point2 laser = T_grid_base(p_base_laser);
    const std::vector<Point2> looked_at = spreadAlongContour(ends, 0.0, kEvidenceBeams);
    std::size_t blocked = 0;
    std::size_t agreeing = 0;
    std::size_t off_map = 0;
    double sharp = 0.0;
    p_map_unmapped.clear();
    for (const Point2& p_base_end : looked_at) {
      const Point2 end = T_grid_base(p_base_end);
      const double d_m = field.atGrid(end, kFar_m);
      if (d_m > params.beam_skipping.distance_m) {
        p_map_unmapped.push_back(transform(map->T_map_grid(), end));
      }
      if (map->atGrid(end) == grid::Cell::kUnknown) ++off_map;
      // A beam that ends on an obstacle behind another one has clipped a corner, or a thick wall.
      const bool fits = d_m < params.inlier_distance_m;
      const double range_m = std::hypot(end.x - laser.x, end.y - laser.y);
      const double mapped_m = field.firstObstacle(laser, end, kAgreeing_m);
      if (!fits && mapped_m < range_m - kBlockedMargin_m) ++blocked;
      if (std::abs(mapped_m - range_m) < kAgreeing_m) ++agreeing;
      sharp += std::exp(-0.5 * d_m * d_m / (kSharp_m * kSharp_m));
    }
    const double n = std::max<double>(1.0, static_cast<double>(looked_at.size()));
    evidence.inlier_share = report.inlier_share;
    evidence.slow_blocked_share = static_cast<double>(blocked) / n;
    evidence.agreeing_share = static_cast<double>(agreeing) / n;
    evidence.sharp_share = sharp / n;
    evidence.off_map_share = static_cast<double>(off_map) / n;
    evidence.spread_m = std::sqrt(report.T_map_base.cov(0, 0) + report.T_map_base.cov(1, 1));
  }

  /// \param dt_s since the last scan; the first scan counts alone
  /// \param driven_m since the last scan
  void judge(double dt_s, double driven_m, bool first) {
    const auto keptAfter = [&](double time_constant_s) {
      return first ? 0.0 : std::exp(-dt_s / time_constant_s);
    };
    const double keep = keptAfter(params.trust_time_constant_s);
    const double keep_slowly = keptAfter(kSlowEvidence_s);
    const auto smooth = [keep](double& value, double seen) {
      value = keep * value + (1.0 - keep) * seen;
    };
    LostEvidence& e = report.evidence;
    e.slow_blocked_share =
        keep_slowly * e.slow_blocked_share + (1.0 - keep_slowly) * evidence.slow_blocked_share;
    e.slow_agreeing_share =
        keep_slowly * e.slow_agreeing_share + (1.0 - keep_slowly) * evidence.agreeing_share;
    smooth(e.inlier_share, evidence.inlier_share);
    smooth(e.agreeing_share, evidence.agreeing_share);
    smooth(e.sharp_share, evidence.sharp_share);
    const double remembered = first ? 0.0 : std::exp(-driven_m / kMemory_m);
    e.worst_blocked_share = std::max(
        e.slow_blocked_share,
        e.slow_blocked_share + remembered * (e.worst_blocked_share - e.slow_blocked_share));
    smooth(e.off_map_share, evidence.off_map_share);
    smooth(e.spread_m, evidence.spread_m);
    smooth(e.weakest_sigma_m, evidence.weakest_sigma_m);
    report.trust = e.inlier_share;
    report.trusted = report.trust >= params.lost_inlier_share;
    report.lost_probability = lostProbability(e);
  }

  /// Says once when scans come without odometry: then only the scans move the pose.
  void checkOdometry(Timestamp stamp) {
    const Timestamp since = last_odometry ? *last_odometry : first_scan_stamp.value_or(stamp);
    if (!first_scan_stamp) first_scan_stamp = stamp;
    const double silent_s = toSeconds(stamp - since);
    const bool missing = silent_s > kNoOdometry_s;
    if (missing && !odometry_missing) {
      warn(stamp, "no odometry for a while: only scans move the pose", silent_s, kNoOdometry_s);
    }
    odometry_missing = missing;
  }

  void warn(Timestamp stamp, const std::string& text, double value, double limit) const {
    if (observers == nullptr) return;
    WarningEvent event;
    event.stamp = stamp;
    event.component = "amcl";
    event.text = text;
    event.value = value;
    event.limit = limit;
    observers->emit(event);
  }

  /// Why a scan cannot be used at all; empty when it can.
  [[nodiscard]] std::string refusal(const LaserScan& scan, std::size_t beams) const {
    if (!isFinite(scan.T_base_laser)) return "laser pose unknown";
    if (beams < kMinBeams) return "too few beams with an echo";
    if (start_stamp && scan.stamp < *start_stamp &&
        toSeconds(*start_stamp - scan.stamp) < kOldScan_s) {
      return "older than the start in this map";
    }
    return {};
  }

  /// Leaves out beams that end far from every obstacle for most of the particles.
  [[nodiscard]] std::vector<Point2> withoutSkipped(
      const std::vector<Point2>& ends, const Pose2& increment) {
    const BeamSkipping& p = params.beam_skipping;
    if (!p.enabled || spread() > kConvergedSpread_m) return ends;
    constexpr std::size_t kSamples = 64;
    const std::size_t samples = std::min(kSamples, particles.size());
    std::vector<std::size_t> fits(ends.size(), 0);
    for (std::size_t k = 0; k < samples; ++k) {
      const Turned T(compose(particles.pose(k * particles.size() / samples), increment));
      for (std::size_t b = 0; b < ends.size(); ++b) {
        if (field.atGrid(T(ends[b]), kFar_m) < p.distance_m) ++fits[b];
      }
    }
    std::vector<Point2> kept;
    for (std::size_t b = 0; b < ends.size(); ++b) {
      if (static_cast<double>(fits[b]) >= p.min_share * static_cast<double>(samples)) {
        kept.push_back(ends[b]);
      }
    }
    const auto skipped = static_cast<double>(ends.size() - kept.size());
    if (skipped > p.max_skipped * static_cast<double>(ends.size()) || kept.size() < kMinBeams) {
      return ends;
    }
    return kept;
  }

  void updateParticles(
      const std::vector<Point2>& all_ends, const Point2& p_base_laser, const Pose2& T_odom_scan) {
    const PoseWithCovariance step = likelyMotion(motionTo(T_odom_scan), params.motion);
    const std::vector<Point2> chosen = weighed(all_ends);
    const std::vector<Point2> ends = withoutSkipped(chosen, step.mean);
    report.beams = ends.size();
    report.beams_skipped = chosen.size() - ends.size();

    // While the particles are spread over the map one scan must not kill all modes but one: it is
    // tempered more, and the particles stay many.
    const bool searching = spread() > kConvergedSpread_m;
    const double effective_beams =
        params.field.effective_beams * (searching ? kSearchTempering : 1.0);
    driver.m_options.powFactor = std::min(1.0, effective_beams / static_cast<double>(ends.size()));
    particles.prepare({noisyIncrement(step), noiseKey(kMotionNoise), &ends});
    mrpt::bayes::CParticleFilter::TParticleFilterStats stats;
    driver.executeOn(particles, nullptr, nullptr, &stats);
    report.effective_sample_size = stats.ESS_beforeResample * static_cast<double>(particles.size());

    const PoseWithCovariance predicted = composeBoth(estimate, step);
    // An error of the yaw moves the pose sideways of the way, and so what it shares with the
    // offset.
    Eigen::Vector3d offset_cov = wall_offset_cov;
    offset_cov.x() -= (predicted.mean.y - estimate.mean.y) * wall_offset_cov.z();
    offset_cov.y() += (predicted.mean.x - estimate.mean.x) * wall_offset_cov.z();
    summarise();
    if (params.refinement.enabled && spread() <= kConvergedSpread_m) {
      follow(step, predicted, offset_cov, all_ends, p_base_laser);
      if (misfits()) searchAround(step, predicted, all_ends, p_base_laser);
    } else {
      tracking = false;
    }
    resample(searching);
    T_odom_update = T_odom_scan;
    timing_var_m2 = odometry.timingVar_m2();
    travelled_m = turned_rad = gyro_rad = 0.0;
  }

  [[nodiscard]] std::vector<Point2> weighed(const std::vector<Point2>& ends) const {
    return spreadAlongContour(ends, params.field.min_spacing_m, params.field.max_beams);
  }

  [[nodiscard]] TrackState trackState(
      const PoseWithCovariance& T, const Eigen::Vector3d& offset_cov) const {
    TrackState state;
    state.T_grid_base = T.mean;
    state.wall_offset_m = learnt.wall_offset_m;
    state.cov.topLeftCorner<3, 3>() = T.cov;
    state.cov.topRightCorner<3, 1>() = offset_cov;
    state.cov.bottomLeftCorner<1, 3>() = offset_cov.transpose();
    state.cov(3, 3) = learnt.wall_offset_var_m2 + kWallOffsetWalk_m * kWallOffsetWalk_m;
    return state;
  }

  /// Refines the estimate: from where the odometry led it while that goes well, from the particles
  /// otherwise.
  void follow(
      const PoseWithCovariance& step,
      const PoseWithCovariance& predicted,
      const Eigen::Vector3d& offset_cov,
      const std::vector<Point2>& all_ends,
      const Point2& p_base_laser) {
    const std::vector<Point2> ends = spreadAlongContour(all_ends, 0.0, params.refinement.max_beams);
    const PoseWithCovariance cloud = estimate;
    const auto from = [&](const TrackState& prior) {
      return refine(
          field, ends, p_base_laser, prior, prior.T_grid_base, residual_sigma_m, params.refinement);
    };
    std::optional<Refinement> best;
    bool moved_off = false;
    if (tracking) {
      best = from(trackState(predicted, offset_cov));
      const Eigen::Matrix3d both = cloud.cov + best->state.cov.topLeftCorner<3, 3>();
      if (best->correction_chi2 > kSurprisingChi2) {
        // Perhaps the wheels slipped by far more than their noise says.
        const Refinement slipped = from(trackState(
            withSlip(predicted, translationNorm(step.mean), std::abs(step.mean.phi)),
            Eigen::Vector3d::Zero()));
        if (slipped.cost + kSlipCost < best->cost) {
          best = slipped;
          moved_off = true;
        }
      }
      if (mahalanobis2(cloud.mean, best->state.T_grid_base, both) > kOtherPlaceChi2) {
        const Refinement other = from(trackState(cloud, Eigen::Vector3d::Zero()));
        const double temper = params.field.effective_beams / static_cast<double>(ends.size());
        const double gain = temper * (table.logLikelihood(other.state.T_grid_base, ends) -
                                      table.logLikelihood(best->state.T_grid_base, ends));
        if (gain > kOtherPlaceMargin) best = other;
      }
    } else {
      best = from(trackState(cloud, Eigen::Vector3d::Zero()));
    }
    accept(*best);
    if (moved_off) gatherParticles();
  }

  /// Where the robot may be after a slip: a threshold, a collision, a message that got lost.
  [[nodiscard]] static PoseWithCovariance withSlip(
      PoseWithCovariance predicted, double length_m, double turn_rad) {
    const double sigma_m = 0.1 + 0.3 * length_m;
    const double sigma_rad = degToRad(4.0) + 0.2 * turn_rad;
    predicted.cov +=
        Eigen::Vector3d(sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad).asDiagonal();
    return predicted;
  }

  /// All particles about the refined pose.
  void gatherParticles() {
    PoseWithCovariance about = estimate;
    about.cov += Eigen::Vector3d(0.05 * 0.05, 0.05 * 0.05, 0.02 * 0.02).asDiagonal();
    fill(particles, 0, particles.size(), particles.size(), about, stream("amcl-around"));
    particles.normalizeWeights();
  }

  void accept(const Refinement& refined) {
    estimate = {refined.state.T_grid_base, refined.state.cov.topLeftCorner<3, 3>()};
    learnt.wall_offset_m = refined.state.wall_offset_m;
    learnt.wall_offset_var_m2 = refined.state.cov(3, 3);
    wall_offset_cov = refined.state.cov.topRightCorner<3, 1>();
    fitting_share = refined.fitting_share;
    evidence.weakest_sigma_m = weakestSigma(refined.scan_information);
    tracking = true;
    // The spread of fitting beams changes slowly: it is the sensor's and the map's.
    constexpr double kKept = 0.9;
    const double seen = std::clamp(
        refined.residual_sigma_m, params.refinement.min_sigma_m, params.refinement.max_sigma_m);
    residual_sigma_m = kKept * residual_sigma_m + (1.0 - kKept) * seen;
  }

  /// Whether this scan fits clearly worse than those before.
  [[nodiscard]] bool misfits() {
    constexpr double kKept = 0.9;
    const bool worse = usual_fitting_share > 0.0 && fitting_share < kMisfit * usual_fitting_share;
    usual_fitting_share = usual_fitting_share > 0.0
                              ? kKept * usual_fitting_share + (1.0 - kKept) * fitting_share
                              : fitting_share;
    return worse;
  }

  /// Wheels slip now and then by far more than their noise says (a threshold, a collision). When a
  /// scan stops fitting, poses all around the expected one are tried on it, and the particles move
  /// where it fits better.
  void searchAround(
      const PoseWithCovariance& step,
      const PoseWithCovariance& predicted,
      const std::vector<Point2>& all_ends,
      const Point2& p_base_laser) {
    const PoseWithCovariance wide =
        withSlip(predicted, translationNorm(step.mean), std::abs(step.mean.phi));
    const std::vector<Point2> ends = weighed(all_ends);
    ParticleSet tries(table, params.threads);
    constexpr std::size_t kTries = 3000;
    fill(tries, 0, kTries, kTries, wide, stream("amcl-around"));
    const std::vector<double>& fits = tries.logLikelihoods(ends);
    const auto best_try =
        static_cast<std::size_t>(std::max_element(fits.begin(), fits.end()) - fits.begin());
    const double temper = params.field.effective_beams / static_cast<double>(ends.size());
    const Refinement other = refine(
        field,
        spreadAlongContour(all_ends, 0.0, params.refinement.max_beams),
        p_base_laser,
        trackState(wide, Eigen::Vector3d::Zero()),
        tries.pose(best_try),
        residual_sigma_m,
        params.refinement);
    const double gain = temper * (table.logLikelihood(other.state.T_grid_base, ends) -
                                  table.logLikelihood(estimate.mean, ends));
    if (gain < kSearchMargin) return;
    accept(other);
    gatherParticles();
  }

  /// Draws particles [from, to) of `size` from a Gaussian.
  static void fill(
      ParticleSet& set,
      std::size_t from,
      std::size_t to,
      std::size_t size,
      const PoseWithCovariance& T_grid_base,
      RandomStream rng) {
    if (set.size() != size) set.resize(size);
    const Eigen::Matrix3d L = T_grid_base.cov.llt().matrixL();
    for (std::size_t i = from; i < to; ++i) {
      const Eigen::Vector3d z(rng.normal(), rng.normal(), rng.normal());
      const Eigen::Vector3d d = L * z;
      set.set(
          i,
          {T_grid_base.mean.x + d.x(), T_grid_base.mean.y + d.y(), T_grid_base.mean.phi + d.z()});
      set.setW(i, 0.0);
    }
  }

  void resample(bool searching) {
    const std::size_t largest = static_cast<std::size_t>(
        searching ? params.global_max_particles : params.kld.max_particles);
    const std::size_t now = particles.size();
    const auto smallest = static_cast<std::size_t>(params.kld.min_particles);
    RandomStream rng = stream("amcl-resample");
    const double u = rng.uniform();
    std::size_t wanted = std::min(now, largest);
    for (int i = 0; i < 2; ++i) {
      const std::size_t bins = occupiedBins(
          particles, particles.systematicDraws(wanted, u), params.kld.bin_m, params.kld.bin_rad);
      wanted =
          std::clamp(kldSampleSize(bins, params.kld.epsilon, params.kld.delta), smallest, largest);
    }
    const bool enough = particles.ESS() >= params.resampling.below_effective_share;
    const bool fitting_count = wanted * 2 > now && wanted < now * 2;
    if (!(enough && fitting_count)) {
      const PoseWithCovariance cloud = particles.moments();
      particles.resample(wanted, u);
      if (!searching && tracking) {
        smoothen(cloud);
        inject(rng);
      }
      particles.normalizeWeights();
    }
    report.particles = particles.size();
  }

  /// Copies of one particle are spread by a kernel as wide as the cloud lets it (regularised
  /// particle filter: Musso, Oudjane, Le Gland 2001).
  void smoothen(const PoseWithCovariance& cloud) {
    const double h =
        params.resampling.kernel * std::pow(static_cast<double>(particles.size()), -1.0 / 7.0);
    const Eigen::Matrix3d R = rotation(-cloud.mean.phi);
    PoseWithCovariance kernel;
    kernel.cov = h * h * R * cloud.cov * R.transpose();
    kernel.cov += Eigen::Vector3d(1e-8, 1e-8, 1e-10).asDiagonal();
    particles.diffuse(noisyIncrement(kernel), noiseKey(kKernelNoise));
  }

  /// Some particles come from the refined pose, so that the cloud follows where it is right.
  void inject(RandomStream& rng) {
    const auto n = static_cast<std::size_t>(
        params.refinement.injected_share * static_cast<double>(particles.size()));
    if (n == 0) return;
    const Eigen::Matrix3d L = estimate.cov.llt().matrixL();
    for (std::size_t k = 0; k < n; ++k) {
      const Eigen::Vector3d z(rng.normal(), rng.normal(), rng.normal());
      const Eigen::Vector3d d = L * z;
      particles.set(
          k * particles.size() / n,
          {estimate.mean.x + d.x(), estimate.mean.y + d.y(), estimate.mean.phi + d.z()});
    }
  }

  void emitParticles(Timestamp stamp) const {
    std::vector<Pose2> poses;
    poses.reserve(particles.size());
    for (std::size_t i = 0; i < particles.size(); ++i) {
      poses.push_back(compose(map->T_map_grid(), particles.pose(i)));
    }
    observers->emit(ParticlesEvent{
        stamp,
        poses,
        particles.weights(),
        report.effective_sample_size,
        report.inlier_share,
        report.lost_probability,
        p_map_unmapped});
  }
};

ParticleLocalizer::ParticleLocalizer(
    const AmclParams& params,
    std::shared_ptr<const grid::OccupancyMap> map,
    std::uint64_t seed,
    const Observers* observers,
    const LearntOfMap& learnt)
    : impl_(std::make_unique<Impl>(params, std::move(map), seed, observers, learnt)) {}

ParticleLocalizer::~ParticleLocalizer() = default;

std::shared_ptr<const grid::DistanceField> ParticleLocalizer::distances() const {
  return impl_->distances;
}

void ParticleLocalizer::initialise(const PoseWithCovariance& T_map_base) {
  initialise(std::vector<PoseMode>{{T_map_base, 1.0}});
}

void ParticleLocalizer::initialise(const std::vector<PoseMode>& modes) {
  double weight_sum = 0.0;
  for (const PoseMode& mode : modes) weight_sum += mode.weight;
  assert(weight_sum > 0.0);
  const auto n = static_cast<std::size_t>(impl_->params.kld.max_particles);
  impl_->particles.resize(n);
  // Each mode gets its share of the particles, in order; rounding goes to the last.
  std::size_t next = 0;
  double weight_so_far = 0.0;
  for (const PoseMode& mode : modes) {
    weight_so_far += mode.weight;
    const auto end =
        static_cast<std::size_t>(std::llround(static_cast<double>(n) * weight_so_far / weight_sum));
    const PoseWithCovariance T_grid_base =
        compose(inverse(impl_->map->T_map_grid()), mode.T_map_base);
    Impl::fill(impl_->particles, next, end, n, T_grid_base, impl_->stream("amcl-init"));
    next = end;
  }
  impl_->restart();
}

void ParticleLocalizer::initialiseGlobally() {
  const grid::OccupancyMap& map = *impl_->map;
  const FreeCells free_cells(map);
  const double free_m2 =
      static_cast<double>(free_cells.size()) * map.resolution() * map.resolution();
  const int n = std::clamp(
      static_cast<int>(free_m2 * impl_->params.global_particles_per_m2),
      std::min(2000, impl_->params.global_max_particles),
      impl_->params.global_max_particles);
  RandomStream rng = impl_->stream("amcl-init");
  impl_->particles.resize(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    const std::size_t cell = free_cells[static_cast<std::size_t>(
        rng.uniform() * static_cast<double>(free_cells.size()))];
    const auto width = static_cast<std::size_t>(map.width());
    const double x = static_cast<double>(cell % width) + rng.uniform();
    const double y = static_cast<double>(cell / width) + rng.uniform();
    impl_->particles.set(
        static_cast<std::size_t>(i),
        {map.corner().x + x * map.resolution(),
         map.corner().y + y * map.resolution(),
         rng.uniform(-kPi, kPi)});
  }
  impl_->restart();
}

bool ParticleLocalizer::initialised() const { return impl_->initialised; }

void ParticleLocalizer::process(const WheelOdometry& odometry, YawSource yaw_source) {
  if (!isFinite(odometry.T_previous_now)) {
    impl_->warn(odometry.stamp, "odometry that is not finite was dropped", 0.0, 0.0);
    return;
  }
  impl_->odometry.add(odometry);
  impl_->last_odometry = odometry.stamp;
  const double turn = std::abs(odometry.T_previous_now.phi);
  impl_->travelled_m += translationNorm(odometry.T_previous_now);
  impl_->turned_rad += turn;
  if (yaw_source == YawSource::kGyro) impl_->gyro_rad += turn;
}

ScanReport ParticleLocalizer::process(const LaserScan& scan) {
  assert(initialised());
  Impl& s = *impl_;
  const std::vector<Point2> ends = beamEnds(scan, s.params.field.max_range_m, s.odometry.twist());
  const Pose2 T_odom_scan = s.odometry.at(scan.stamp);
  const Pose2 T_update_scan = between(s.T_odom_update, T_odom_scan);
  const bool moved = translationNorm(T_update_scan) >= s.params.update_min_d_m ||
                     std::abs(T_update_scan.phi) >= s.params.update_min_a_rad;
  const double since_update_s = std::abs(toSeconds(scan.stamp - s.last_update));
  const bool due = s.first_scan || moved || since_update_s >= s.params.update_max_s ||
                   s.surprises(scan, ends, T_odom_scan);
  s.report.unused_reason = s.refusal(scan, ends.size());
  if (s.report.unused_reason != s.last_refusal) {
    s.last_refusal = s.report.unused_reason;
    if (!s.last_refusal.empty()) {
      s.warn(
          scan.stamp,
          "scan not used: " + s.last_refusal,
          static_cast<double>(ends.size()),
          static_cast<double>(kMinBeams));
    }
  }
  s.checkOdometry(scan.stamp);
  s.report.used = s.report.unused_reason.empty() && due;
  if (s.report.unused_reason.empty() && !due) s.report.unused_reason = "too little motion";
  if (s.report.used) {
    s.updateParticles(ends, {scan.T_base_laser.x, scan.T_base_laser.y}, T_odom_scan);
    s.last_update = scan.stamp;
  }

  s.report.T_map_base = s.carriedTo(T_odom_scan);
  s.report.inlier_share = inlierShare(
      scan,
      s.report.T_map_base.mean,
      s.field,
      s.params.inlier_distance_m,
      s.params.field.max_range_m);
  const double dt_s = std::abs(toSeconds(scan.stamp - s.last_scan));
  s.collectEvidence(ends, {scan.T_base_laser.x, scan.T_base_laser.y});
  s.judge(dt_s, distance(s.T_odom_last_scan, T_odom_scan), s.first_scan);
  s.last_scan = scan.stamp;
  s.T_odom_last_scan = T_odom_scan;
  if (s.report.used) s.first_scan = false;

  if (s.observers != nullptr && s.report.used) s.emitParticles(scan.stamp);
  return s.report;
}

void ParticleLocalizer::process(const Point2& p_map_base, double sigma_m) {
  const GnssTerm& p = impl_->params.gnss;
  if (!p.enabled || !impl_->initialised) return;
  const Point2 at = transform(inverse(impl_->map->T_map_grid()), p_map_base);
  const Pose2 T_update_now = between(impl_->T_odom_update, impl_->odometry.now());
  const double sigma = std::max(p.min_sigma_m, sigma_m);
  ParticleSet& particles = impl_->particles;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Pose2 T = compose(particles.pose(i), T_update_now);
    const double u = std::hypot(T.x - at.x, T.y - at.y) / sigma;
    particles.setW(i, particles.getW(i) + std::log(p.clutter + std::exp(-0.5 * u * u)));
  }
  particles.normalizeWeights();
}

PoseWithCovariance ParticleLocalizer::pose() const {
  assert(initialised());
  return impl_->carriedTo(impl_->odometry.now());
}

std::vector<PoseMode> ParticleLocalizer::modes() const {
  assert(initialised());
  if (impl_->tracking) return {{pose(), 1.0}};
  const Pose2 T_update_now = between(impl_->T_odom_update, impl_->odometry.now());
  std::vector<PoseMode> modes;
  for (const Clusters::One& place : impl_->places) {
    if (!modes.empty() && place.weight < kClusterShare) break;
    modes.push_back(
        {compose(impl_->map->T_map_grid(), compose(place.T_grid_base, T_update_now)),
         place.weight});
  }
  return modes;
}

const ScanReport& ParticleLocalizer::lastReport() const { return impl_->report; }

const grid::OccupancyMap& ParticleLocalizer::map() const { return *impl_->map; }

const LearntOfMap& ParticleLocalizer::learnt() const { return impl_->learnt; }

}  // namespace vestibule::amcl
