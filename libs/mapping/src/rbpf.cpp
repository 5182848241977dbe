#include "vestibule/mapping/rbpf.hpp"

#include <mrpt/bayes/CParticleFilter.h>
#include <mrpt/bayes/CParticleFilterCapable.h>
#include <mrpt/bayes/CParticleFilterData.h>
#include <mrpt/random/RandomGenerators.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <optional>
#include <unordered_set>

#include "scan_integrator.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/parallel.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/mapping/scan_matcher.hpp"

namespace vestibule::mapping {
namespace {

using mrpt::bayes::CParticleFilter;

constexpr double kSlipChi2 = 25.0;     // odometry this far from the scan has slipped
constexpr double kSlipLeft = 4.0;      // squared distance left to it then
constexpr double kSearchSigmas = 3.0;  // of odometry, half side of the search
constexpr double kSearchMargin_rad = degToRad(2.0);
// A wider search finds something that fits by chance in most maps: it is believed only if nearly
// all of the scan fits there, and much better than near the odometry.
// It is made already when a fit is doubtful: a path that comes back beside an old one fits half.
constexpr double kDoubtfulShare = 0.75;
constexpr double kWideMatchedShare = 0.6;
constexpr double kWideKnownShare = 0.85;
constexpr double kWideGain = 0.25;  // of the log-likelihood per beam
// The same for a match that the odometry excludes; closing a loop is one, and gains little at
// first.
constexpr double kSlipGain = 0.03;
constexpr double kJump = 2.0;       // odometry between two updates, of what makes an update due
constexpr double kStillGain = 0.1;  // as kWideGain, where only such a jump speaks against a place
constexpr double kLongGap_s = 0.5;

struct Particle {
  Pose2 T_map_base;
  PatchMap map;
  double score = 0.0;  // log-likelihood of the whole path
  Pose2 proposal_mean;
  Eigen::Matrix3d proposal_root;  // lower triangular; times standard normals = sample
  std::uint32_t parent = 0;
};

/// Everything that the particles of one update have in common.
struct Step {
  const LaserScan* scan = nullptr;
  ScanPoints points;
  Pose2 T_previous_odometry;  // base after the odometry since the last update, in the one then
  Pose2 T_previous_guess;     // the same as the best particle's scan match says
  Eigen::Matrix3d odometry_information;  // in the axes of the base
};

Eigen::Matrix3d rotated(const Eigen::Matrix3d& information, double yaw) {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  R.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(yaw).toRotationMatrix();
  return R * information * R.transpose();
}

/// MRPT's particle filter over our particles.
class Filter : public mrpt::bayes::CParticleFilterData<Particle>,
               public mrpt::bayes::CParticleFilterDataImpl<
                   Filter,
                   mrpt::bayes::CParticleFilterData<Particle>::CParticleList> {
 public:
  explicit Filter(const FilterParams& params) : params_(params) {
    const std::size_t threads =
        std::min(threadCount(params.threads), static_cast<std::size_t>(params.particles));
    for (std::size_t i = 0; i < threads; ++i) {
      matchers_.emplace_back(params.matcher);
      integrators_.emplace_back(params.map, params.free_range_m);
    }
  }

  void prediction_and_update_pfOptimalProposal(
      const mrpt::obs::CActionCollection* /*action*/,
      const mrpt::obs::CSensoryFrame* /*observation*/,
      const CParticleFilter::TParticleFilterOptions& options) override {
    forEachParticle([&](std::size_t worker, std::size_t i) {
      Particle& p = *m_particles[i].d;
      p.parent = static_cast<std::uint32_t>(i);
      const double log_weight = propose(matchers_[worker], p);
      p.score += log_weight;
      m_particles[i].log_w += options.powFactor * log_weight;
    });
  }

  /// Draws every particle from its proposal and writes the scan into its map.
  void sampleAndIntegrate(std::uint64_t seed, std::uint64_t update) {
    forEachParticle([&](std::size_t worker, std::size_t i) {
      Particle& p = *m_particles[i].d;
      RandomStream stream(
          derivedSeed(seed, "mapping proposal", update), "particle", static_cast<std::uint64_t>(i));
      const Eigen::Vector3d normals(stream.normal(), stream.normal(), stream.normal());
      const Eigen::Vector3d d = params_.proposal_spread * (p.proposal_root * normals);
      p.T_map_base = {
          p.proposal_mean.x + d.x(),
          p.proposal_mean.y + d.y(),
          wrapToPi(p.proposal_mean.phi + d.z())};
      integrators_[worker].integrate(p.map, *step.scan, p.T_map_base);
    });
  }

  [[nodiscard]] ScanMatcher& matcher() { return matchers_.front(); }
  [[nodiscard]] ScanIntegrator& integrator() { return integrators_.front(); }

  Step step;

 private:
  /// Calls work(worker, i) for every particle; each worker has a matcher and an integrator of its
  /// own, and which of them takes which particle is fixed.
  template <class Work>
  void forEachParticle(const Work& work) {
    const std::size_t workers = matchers_.size();
    parallelFor(workers, workers, [&](std::size_t worker) {
      for (std::size_t i = worker; i < m_particles.size(); i += workers) work(worker, i);
    });
  }

  /// Sets the particle's proposal; returns its log weight:
  /// log of the integral of p(scan | x) p(x | odometry), by Laplace's method at its maximum.
  double propose(ScanMatcher& matcher, Particle& p) const {
    PosePrior prior;
    prior.mean = compose(p.T_map_base, step.T_previous_odometry);
    prior.information = rotated(step.odometry_information, p.T_map_base.phi);
    const Pose2 guess = compose(p.T_map_base, step.T_previous_guess);
    Refinement best = matcher.refine(p.map, step.points, guess, prior);
    ScanFit fit = matcher.fit(p.map, step.points, best.T_map_base);
    if (fit.known_share < params_.matcher.poor_share) {
      // This particle's map differs from the best one's: it searches for itself.
      const Pose2 found = matcher.search(
          p.map, step.points, prior, params_.matcher.window_m, params_.matcher.window_rad);
      const Refinement other = matcher.refine(p.map, step.points, found, prior);
      const ScanFit other_fit = matcher.fit(p.map, step.points, other.T_map_base);
      if (other_fit.log_likelihood - 0.5 * other.prior_chi2 >
          fit.log_likelihood - 0.5 * best.prior_chi2) {
        best = other;
        fit = other_fit;
      }
    }
    const Eigen::Matrix3d posterior = best.information + prior.information;
    const Eigen::Matrix3d covariance = posterior.inverse();
    p.proposal_mean = best.T_map_base;
    p.proposal_root = covariance.llt().matrixL();
    const double log_volume =
        0.5 * std::log(prior.information.determinant() / posterior.determinant());
    return fit.log_likelihood - 0.5 * best.prior_chi2 + log_volume;
  }

  FilterParams params_;
  std::vector<ScanMatcher> matchers_;
  std::vector<ScanIntegrator> integrators_;
};

}  // namespace

struct Rbpf::Impl {
  FilterParams params;
  std::uint64_t seed;
  const Observers* observers;
  Filter filter;
  CParticleFilter driver;
  std::vector<Generation> generations;

  std::vector<Generation> recorded;          // of an earlier run of the same drive
  std::vector<std::vector<char>> descended;  // per recorded generation and particle: has heirs
  std::optional<PatchMap> start_map;

  std::size_t scans = 0;
  Timestamp last_stamp;
  std::optional<Pose2> T_odom_last;    // at the last scan
  std::optional<Pose2> T_odom_update;  // at the last used scan
  Timestamp look_stamp;                // of the last scan that was used or looked at
  double trans_since_m = 0.0;          // driven since the last used scan
  double rot_since_rad = 0.0;
  double turned_rad = 0.0;

  Impl(const FilterParams& p, std::uint64_t s, const Observers* o)
      : params(p), seed(s), observers(o), filter(p) {
    filter.m_particles.resize(static_cast<std::size_t>(params.particles));
    for (auto& particle : filter.m_particles) {
      particle.d.reset(new Particle);
      particle.d->map =
          PatchMap(params.map.resolution_m, params.map.occupied_ratio, params.map.max_count);
    }
    driver.m_options.PF_algorithm = CParticleFilter::pfOptimalProposal;
    driver.m_options.resamplingMethod = CParticleFilter::prSystematic;
    driver.m_options.BETA = params.resample_below;
    driver.m_options.sampleSize = static_cast<unsigned>(params.particles);
  }

  [[nodiscard]] std::size_t best() const {
    std::size_t index = 0;
    for (std::size_t i = 1; i < filter.m_particles.size(); ++i) {
      const auto& a = filter.m_particles[i];
      const auto& b = filter.m_particles[index];
      if (a.log_w > b.log_w || (a.log_w == b.log_w && a.d->score > b.d->score)) index = i;
    }
    return index;
  }

  void follow(const Pose2& T_odom_base) {
    if (T_odom_last) {
      const Pose2 step = between(*T_odom_last, T_odom_base);
      trans_since_m += translationNorm(step);
      rot_since_rad += std::abs(step.phi);
      turned_rad += step.phi;
    }
    T_odom_last = T_odom_base;
  }

  /// Covariance of the motion since the last update, in the axes of the base then.
  [[nodiscard]] Eigen::Matrix3d odometryCovariance() const {
    const OdometryNoise& n = params.odometry;
    const double trans = std::hypot(
        n.min_trans_m, n.trans_per_trans * trans_since_m, n.trans_per_rot * rot_since_rad);
    const double rot =
        std::hypot(n.min_rot_rad, n.rot_per_trans * trans_since_m, n.rot_per_rot * rot_since_rad);
    return Eigen::Vector3d(trans * trans, trans * trans, rot * rot).asDiagonal();
  }

  /// A place that was tried, and how the scan fits there.
  struct Try {
    Pose2 T_map_base;
    ScanFit fit;

    /// Nearly all of the scan fits there, and it is not in the unknown.
    [[nodiscard]] bool sure() const {
      return fit.matched_share >= kWideMatchedShare && fit.known_share >= kWideKnownShare;
    }
  };

  Try attempt(const Particle& p, const PosePrior& around, double window_m, double window_rad) {
    ScanMatcher& matcher = filter.matcher();
    const Pose2 found = matcher.search(p.map, filter.step.points, around, window_m, window_rad);
    const PosePrior free{around.mean, 1e-3 * around.information};
    Try t;
    t.T_map_base = matcher.refine(p.map, filter.step.points, found, free).T_map_base;
    t.fit = matcher.fit(p.map, filter.step.points, t.T_map_base);
    return t;
  }

  /// Where the scan fits the particle's map: near the odometry, else where the robot was before
  /// (its wheels spun), else in a wide window.
  Try findPlace(const Particle& p, const PosePrior& prior, double sigma_rad, double gap_s) {
    const MatcherParams& m = params.matcher;
    // In translation the window is for what the path has drifted when it comes back to a place,
    // not only for the odometry since the last update.
    Try best = attempt(
        p,
        prior,
        m.window_m,
        gap_s > kLongGap_s ? m.window_rad
                           : std::min(m.window_rad, kSearchSigmas * sigma_rad + kSearchMargin_rad));
    const bool jumped = trans_since_m > kJump * params.update_d_m ||
                        std::abs(filter.step.T_previous_odometry.phi) > kJump * params.update_a_rad;
    if (jumped && !best.sure()) {
      PosePrior still;
      still.mean = p.T_map_base;
      still.information.diagonal() << std::pow(params.update_d_m, -2.0),
          std::pow(params.update_d_m, -2.0), std::pow(params.update_a_rad, -2.0);
      const Try here = attempt(p, still, m.window_m, kSearchSigmas * params.update_a_rad);
      if (here.fit.log_likelihood > best.fit.log_likelihood + kStillGain * m.effective_beams) {
        best = here;
      }
    }
    if (best.fit.known_share < kDoubtfulShare) {
      const Try wide = attempt(p, prior, m.wide_window_m, m.wide_window_rad);
      if (wide.sure() &&
          wide.fit.log_likelihood > best.fit.log_likelihood + kWideGain * m.effective_beams) {
        best = wide;
      }
    }
    return best;
  }

  /// Matches the scan with the best particle's map: what all particles start from.
  MapReport lookAhead(const LaserScan& scan, double gap_s) {
    const MatcherParams& m = params.matcher;
    const Particle& p = *filter.m_particles[best()].d;
    Step& step = filter.step;
    Eigen::Matrix3d covariance = odometryCovariance();
    PosePrior prior;
    prior.mean = compose(p.T_map_base, step.T_previous_odometry);
    prior.information = rotated(covariance.inverse(), p.T_map_base.phi);
    Try match = findPlace(p, prior, std::sqrt(covariance(2, 2)), gap_s);
    // Directions in which the scan says nothing follow the odometry, so only a seen contradiction
    // counts, and only one that pays: people and open doors can make any place fit a little better.
    const auto againstOdometry = [&](const Pose2& T) {
      const Eigen::Vector3d d(
          T.x - prior.mean.x, T.y - prior.mean.y, angleDiff(T.phi, prior.mean.phi));
      return d.dot(prior.information * d);
    };
    MapReport report;
    const double chi2 = againstOdometry(match.T_map_base);
    if (chi2 > kSlipChi2) {
      Try stay;
      stay.T_map_base = filter.matcher().refine(p.map, step.points, prior.mean, prior).T_map_base;
      stay.fit = filter.matcher().fit(p.map, step.points, stay.T_map_base);
      report.slipped =
          match.fit.known_share >= m.poor_share &&
          match.fit.log_likelihood > stay.fit.log_likelihood + kSlipGain * m.effective_beams;
      if (report.slipped) {
        covariance *= chi2 / kSlipLeft;
        if (observers != nullptr) {
          observers->emit(WarningEvent{
              scan.stamp,
              "mapping",
              "scan contradicts odometry",
              distance(match.T_map_base, prior.mean),
              0.0});
        }
      } else {
        match = stay;
      }
    }
    report.known_share = match.fit.known_share;
    step.T_previous_guess = between(p.T_map_base, match.T_map_base);
    step.odometry_information = covariance.inverse();
    return report;
  }

  void announce(Timestamp stamp, const MapReport& report) const {
    if (observers == nullptr) return;
    std::vector<Pose2> poses;
    std::vector<double> log_weights;
    for (const auto& particle : filter.m_particles) {
      poses.push_back(particle.d->T_map_base);
      log_weights.push_back(particle.log_w);
    }
    std::vector<double> weights;
    mrpt::bayes::CParticleFilterCapable::log2linearWeights(log_weights, weights);
    observers->emit(
        ParticlesEvent{stamp, poses, weights, report.effective_particles, report.known_share});
  }

  void record(const MapReport& report) {
    Generation g;
    g.scan = scans - 1;
    g.report = report;
    for (const auto& particle : filter.m_particles) {
      g.parents.push_back(particle.d->parent);
      g.poses.push_back(particle.d->T_map_base);
      g.log_weights.push_back(particle.log_w);
      g.scores.push_back(particle.d->score);
    }
    generations.push_back(std::move(g));
  }

  /// Marks the recorded particles that the last generation descends from: only they need a map.
  void markDescent() {
    descended.assign(recorded.size(), {});
    std::vector<char> heirs(static_cast<std::size_t>(params.particles), 1);
    for (std::size_t g = recorded.size(); g-- > 0;) {
      descended[g] = heirs;
      std::vector<char> before(heirs.size(), 0);
      for (std::size_t i = 0; i < heirs.size(); ++i) {
        if (heirs[i] != 0) before[recorded[g].parents[i]] = 1;
      }
      heirs = std::move(before);
    }
  }

  /// Repeats the outcome of a recorded update.
  void repeat(const Generation& g, const LaserScan& scan) {
    auto& particles = filter.m_particles;
    const std::vector<char>& heirs = descended[generations.size()];
    Filter::CParticleList next(particles.size());
    for (std::size_t i = 0; i < next.size(); ++i) {
      next[i].log_w = g.log_weights[i];
      next[i].d.reset(new Particle);
      Particle& p = *next[i].d;
      p.T_map_base = g.poses[i];
      p.score = g.scores[i];
      p.parent = g.parents[i];
      if (heirs[i] != 0) p.map = particles[g.parents[i]].d->map;
    }
    particles = std::move(next);
    for (std::size_t i = 0; i < particles.size(); ++i) {
      if (heirs[i] != 0) {
        filter.integrator().integrate(particles[i].d->map, scan, particles[i].d->T_map_base);
      }
    }
    generations.push_back(g);
  }

  void restartMotion(const LaserScan& scan, const Pose2& T_odom_base) {
    T_odom_update = T_odom_base;
    look_stamp = scan.stamp;
    trans_since_m = rot_since_rad = turned_rad = 0.0;
  }

  MapReport first(const LaserScan& scan, const Pose2& T_odom_base) {
    // All start alike: one map, shared.
    Particle& p = *filter.m_particles.front().d;
    if (start_map) {
      p.map = *start_map;
      start_map.reset();
      const MatcherParams& m = params.matcher;
      const ScanPoints points = matchPoints(scan, m);
      const PosePrior nearby{p.T_map_base, Eigen::Matrix3d::Identity() * 1e-3};
      const Pose2 found =
          filter.matcher().search(p.map, points, nearby, m.wide_window_m, m.wide_window_rad);
      p.T_map_base = filter.matcher().refine(p.map, points, found, nearby).T_map_base;
    }
    filter.integrator().integrate(p.map, scan, p.T_map_base);
    for (auto& particle : filter.m_particles) {
      if (particle.d.get() != &p) *particle.d = p;
    }
    MapReport report;
    report.used = true;
    report.effective_particles = params.particles;
    report.known_share = 1.0;
    record(report);
    announce(scan.stamp, report);
    restartMotion(scan, T_odom_base);
    return report;
  }

  /// A robot that was pushed, or whose wheels say nothing: the scan no longer fits.
  [[nodiscard]] bool movedUnnoticed(const LaserScan& scan, const Pose2& T_odom_base) {
    if (params.update_max_s <= 0.0 ||
        std::abs(toSeconds(scan.stamp - look_stamp)) < params.update_max_s) {
      return false;
    }
    look_stamp = scan.stamp;
    const Particle& p = *filter.m_particles[best()].d;
    const Pose2 expected = compose(p.T_map_base, between(*T_odom_update, T_odom_base));
    const ScanFit fit = filter.matcher().fit(p.map, matchPoints(scan, params.matcher), expected);
    return fit.known_share < params.matcher.poor_share;
  }

  [[nodiscard]] bool due(const LaserScan& scan, const Pose2& T_odom_base) {
    return trans_since_m >= params.update_d_m || std::abs(turned_rad) >= params.update_a_rad ||
           movedUnnoticed(scan, T_odom_base);
  }

  MapReport process(const LaserScan& scan, const Pose2& T_odom_base) {
    ++scans;
    follow(T_odom_base);
    if (!T_odom_update) return first(scan, T_odom_base);
    const double gap_s = std::abs(toSeconds(scan.stamp - last_stamp));
    last_stamp = scan.stamp;
    const bool repeating = generations.size() < recorded.size();
    if (repeating ? recorded[generations.size()].scan != scans - 1 : !due(scan, T_odom_base)) {
      return {};
    }
    if (repeating) {
      repeat(recorded[generations.size()], scan);
      restartMotion(scan, T_odom_base);
      MapReport report = generations.back().report;
      announce(scan.stamp, report);
      report.repeated = true;
      return report;
    }
    Step& step = filter.step;
    step.scan = &scan;
    step.points = matchPoints(scan, params.matcher);
    step.T_previous_odometry = between(*T_odom_update, T_odom_base);
    MapReport report = lookAhead(scan, gap_s);
    report.used = true;

    const std::uint64_t update = generations.size();
    driver.m_options.powFactor = params.weight_power;
    // MRPT draws from one generator per thread: give it a state that depends on us alone.
    mrpt::random::getRandomGenerator() = mrpt::random::CRandomGenerator(
        static_cast<std::uint32_t>(derivedSeed(seed, "mapping resampling", update)));
    CParticleFilter::TParticleFilterStats stats;
    driver.executeOn(filter, nullptr, nullptr, &stats);
    report.effective_particles = stats.ESS_beforeResample * params.particles;
    report.resampled = stats.ESS_beforeResample < params.resample_below;
    filter.sampleAndIntegrate(seed, update);
    record(report);
    announce(scan.stamp, report);
    restartMotion(scan, T_odom_base);
    return report;
  }
};

Rbpf::Rbpf(const FilterParams& params, std::uint64_t seed, const Observers* observers)
    : impl_(std::make_unique<Impl>(params, seed, observers)) {}
Rbpf::~Rbpf() = default;

MapReport Rbpf::process(const LaserScan& scan, const Pose2& T_odom_base) {
  return impl_->process(scan, T_odom_base);
}

void Rbpf::start(const Pose2& T_map_base, const PatchMap& map) {
  assert(impl_->scans == 0);
  impl_->filter.m_particles.front().d->T_map_base = T_map_base;
  impl_->start_map = map;
}

void Rbpf::repeat(std::vector<Generation> generations) {
  assert(impl_->scans == 0);
  assert(
      generations.empty() ||
      generations.front().poses.size() == static_cast<std::size_t>(impl_->params.particles));
  impl_->recorded = std::move(generations);
  impl_->markDescent();
}

std::size_t Rbpf::best() const { return impl_->best(); }
const PatchMap& Rbpf::bestMap() const { return impl_->filter.m_particles[best()].d->map; }

Pose2 Rbpf::pose() const {
  const Particle& p = *impl_->filter.m_particles[best()].d;
  if (!impl_->T_odom_update) return p.T_map_base;
  return compose(p.T_map_base, between(*impl_->T_odom_update, *impl_->T_odom_last));
}

const std::vector<Generation>& Rbpf::generations() const { return impl_->generations; }

std::vector<Pose2> Rbpf::bestPath() const {
  const auto& generations = impl_->generations;
  std::vector<Pose2> path(generations.size());
  std::size_t index = best();
  for (std::size_t g = generations.size(); g-- > 0;) {
    path[g] = generations[g].poses[index];
    index = generations[g].parents[index];
  }
  return path;
}

std::size_t Rbpf::patchBytes() const {
  std::unordered_set<const Patch*> patches;
  for (const auto& particle : impl_->filter.m_particles) {
    for (const PatchRef& ref : particle.d->map.table()) {
      if (ref.get() != nullptr) patches.insert(ref.get());
    }
  }
  std::size_t bytes = 0;
  for (const Patch* patch : patches) bytes += patch->bytes();
  return bytes;
}

}  // namespace vestibule::mapping
