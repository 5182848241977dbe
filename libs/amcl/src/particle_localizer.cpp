#include "vestibule/amcl/particle_localizer.hpp"

#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/random/RandomGenerators.h>
#include <mrpt/slam/CMonteCarloLocalization2D.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <tuple>

#include "likelihood_table.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::amcl {
namespace {

constexpr std::size_t kMinBeams = 10;
constexpr double kConvergedSpread_m = 1.5;
constexpr double kSearchTempering = 0.5;

/// MRPT's filter with our likelihood under it.
class Filter : public mrpt::slam::CMonteCarloLocalization2D {
 public:
  explicit Filter(LikelihoodTable table) : table_(std::move(table)) {}

  double PF_SLAM_computeObservationLikelihoodForParticle(
      const mrpt::bayes::CParticleFilter::TParticleFilterOptions& /*options*/,
      const size_t /*particle*/,
      const mrpt::obs::CSensoryFrame& /*frame*/,
      const mrpt::poses::CPose3D& x) const override {
    return table_.logLikelihood({x.x(), x.y(), x.yaw()}, beams);
  }

  BeamEnds beams;  ///< of the scan being weighed

 private:
  LikelihoodTable table_;
};

}  // namespace

double inlierShare(
    const LaserScan& scan,
    const Pose2& T_map_base,
    const grid::DistanceField& field,
    double inlier_distance_m,
    double max_range_m) {
  const Pose2 T_map_laser = compose(T_map_base, scan.T_base_laser);
  std::size_t valid = 0;
  std::size_t inliers = 0;
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const auto range = static_cast<double>(scan.ranges_m[i]);
    if (!scan.valid(i) || range > max_range_m) continue;
    ++valid;
    const Point2 end =
        transform(T_map_laser, {range * std::cos(scan.angle(i)), range * std::sin(scan.angle(i))});
    if (field.at(end, max_range_m) < inlier_distance_m) ++inliers;
  }
  if (valid < kMinBeams) return 0.0;
  return static_cast<double>(inliers) / static_cast<double>(valid);
}

struct ParticleLocalizer::Impl {
  AmclParams params;
  std::shared_ptr<const grid::OccupancyMap> map;
  grid::DistanceField field;
  std::uint64_t seed;
  const Observers* observers;

  Filter filter;
  mrpt::bayes::CParticleFilter driver;
  bool initialised = false;
  std::uint64_t draws = 0;  // numbers every use of the random generator
  bool first_scan = true;   // the first scan after initialising is always used
  Timestamp last_update;
  Timestamp last_scan;
  Pose2 T_update_now;  // odometry since the last used scan
  PoseWithCovariance T_grid_update;
  ScanReport report;

  Impl(
      const AmclParams& p,
      std::shared_ptr<const grid::OccupancyMap> m,
      std::uint64_t s,
      const Observers* o)
      : params(p),
        map(std::move(m)),
        field(*map),
        seed(s),
        observers(o),
        filter(LikelihoodTable(*map, field, params.field)) {
    filter.options.metricMap = map->mrptGrid();  // MRPT insists on one; it is not read
    filter.options.KLD_params.KLD_minSampleSize = static_cast<unsigned>(params.kld.min_particles);
    filter.options.KLD_params.KLD_epsilon = params.kld.epsilon;
    filter.options.KLD_params.KLD_delta = params.kld.delta;
    filter.options.KLD_params.KLD_binSize_XY = params.kld.bin_m;
    filter.options.KLD_params.KLD_binSize_PHI = params.kld.bin_rad;

    driver.m_options.PF_algorithm = mrpt::bayes::CParticleFilter::pfStandardProposal;
    driver.m_options.adaptiveSampleSize = true;
    // Adaptive size needs multinomial resampling in MRPT.
    driver.m_options.resamplingMethod = mrpt::bayes::CParticleFilter::prMultinomial;
  }

  /// MRPT draws from one generator per thread: give it a state that depends on us alone. A fresh
  /// object, because randomize() leaves the spare value of the normal distribution behind.
  void seedGenerator() {
    mrpt::random::getRandomGenerator() = mrpt::random::CRandomGenerator(
        static_cast<std::uint32_t>(derivedSeed(seed, "amcl", draws++)));
  }

  void restart() {
    initialised = true;
    first_scan = true;
    T_update_now = {};
    report = {};
    updateMean();
  }

  void updateMean() {
    mrpt::math::CMatrixDouble33 cov;
    mrpt::poses::CPose2D mean;
    std::tie(cov, mean) = filter.getCovarianceAndMean();
    T_grid_update.mean = {mean.x(), mean.y(), wrapToPi(mean.phi())};
    T_grid_update.cov = cov.asEigen();
  }

  [[nodiscard]] PoseWithCovariance pose() const {
    return compose(compose(map->T_map_grid(), T_grid_update), T_update_now);
  }

  void updateParticles(BeamEnds beams) {
    mrpt::obs::CActionRobotMovement2D::TMotionModelOptions model;
    model.modelSelection = mrpt::obs::CActionRobotMovement2D::mmGaussian;
    model.gaussianModel.a1 = params.motion.trans_per_trans;
    model.gaussianModel.a2 = params.motion.trans_per_rot;
    model.gaussianModel.a3 = params.motion.rot_per_trans;
    model.gaussianModel.a4 = params.motion.rot_per_rot;
    model.gaussianModel.minStdXY = params.motion.min_trans_m;
    model.gaussianModel.minStdPHI = params.motion.min_rot_rad;
    mrpt::obs::CActionRobotMovement2D movement;
    movement.computeFromOdometry(
        mrpt::poses::CPose2D(T_update_now.x, T_update_now.y, T_update_now.phi), model);
    movement.motionModelConfiguration = model;
    mrpt::obs::CActionCollection actions;
    actions.insert(movement);

    const mrpt::obs::CSensoryFrame frame;  // the filter looks at its beams instead

    // While the particles are spread over the map one scan must not kill all modes but one: it is
    // tempered more, and the particles stay many.
    const double spread_m = std::sqrt(T_grid_update.cov(0, 0) + T_grid_update.cov(1, 1));
    const bool searching = spread_m > kConvergedSpread_m;
    const double effective_beams =
        params.field.effective_beams * (searching ? kSearchTempering : 1.0);
    driver.m_options.powFactor = std::min(1.0, effective_beams / static_cast<double>(beams.size()));
    filter.options.KLD_params.KLD_maxSampleSize =
        static_cast<unsigned>(searching ? params.global_max_particles : params.kld.max_particles);
    filter.beams = std::move(beams);
    seedGenerator();
    mrpt::bayes::CParticleFilter::TParticleFilterStats stats;
    driver.executeOn(filter, &actions, &frame, &stats);
    report.particles = filter.m_particles.size();
    report.effective_sample_size = stats.ESS_beforeResample * static_cast<double>(report.particles);
    T_update_now = {};
    updateMean();
  }

  void emitParticles(Timestamp stamp) const {
    std::vector<Pose2> poses;
    std::vector<double> weights;
    poses.reserve(filter.m_particles.size());
    double max_log_weight = -1e300;
    for (const auto& p : filter.m_particles) max_log_weight = std::max(max_log_weight, p.log_w);
    double sum = 0.0;
    for (const auto& p : filter.m_particles) {
      poses.push_back(compose(map->T_map_grid(), p.d));
      weights.push_back(std::exp(p.log_w - max_log_weight));
      sum += weights.back();
    }
    for (double& w : weights) w /= sum;
    observers->emit(
        ParticlesEvent{stamp, poses, weights, report.effective_sample_size, report.inlier_share});
  }
};

ParticleLocalizer::ParticleLocalizer(
    const AmclParams& params,
    std::shared_ptr<const grid::OccupancyMap> map,
    std::uint64_t seed,
    const Observers* observers)
    : impl_(std::make_unique<Impl>(params, std::move(map), seed, observers)) {}

ParticleLocalizer::~ParticleLocalizer() = default;

void ParticleLocalizer::initialise(const PoseWithCovariance& T_map_base) {
  initialise(std::vector<PoseMode>{{T_map_base, 1.0}});
}

void ParticleLocalizer::initialise(const std::vector<PoseMode>& modes) {
  double weight_sum = 0.0;
  for (const PoseMode& mode : modes) weight_sum += mode.weight;
  assert(weight_sum > 0.0);
  RandomStream rng(impl_->seed, "amcl-init", impl_->draws++);
  const auto n = static_cast<std::size_t>(impl_->params.kld.max_particles);
  impl_->filter.resetDeterministic(mrpt::math::TPose2D(), n);
  // Each mode gets its share of the particles, in order; rounding goes to the last.
  std::size_t next = 0;
  double weight_so_far = 0.0;
  for (const PoseMode& mode : modes) {
    weight_so_far += mode.weight;
    const auto end = static_cast<std::size_t>(
        std::llround(static_cast<double>(n) * weight_so_far / weight_sum));
    const PoseWithCovariance T_grid_base =
        compose(inverse(impl_->map->T_map_grid()), mode.T_map_base);
    const Eigen::Matrix3d L = T_grid_base.cov.llt().matrixL();
    for (; next < end; ++next) {
      const Eigen::Vector3d z(rng.normal(), rng.normal(), rng.normal());
      const Eigen::Vector3d d = L * z;
      auto& particle = impl_->filter.m_particles[next];
      particle.d = {
          T_grid_base.mean.x + d.x(),
          T_grid_base.mean.y + d.y(),
          wrapToPi(T_grid_base.mean.phi + d.z())};
      particle.log_w = 0.0;
    }
  }
  impl_->restart();
}

void ParticleLocalizer::initialiseGlobally() {
  const double cell_m2 = impl_->map->resolution() * impl_->map->resolution();
  const double free_m2 = static_cast<double>(impl_->map->count(grid::Cell::kFree)) * cell_m2;
  const int n = std::clamp(
      static_cast<int>(free_m2 * impl_->params.global_particles_per_m2),
      std::min(2000, impl_->params.global_max_particles),
      impl_->params.global_max_particles);
  auto grid = mrpt::maps::COccupancyGridMap2D::Create(*impl_->map->mrptGrid());
  impl_->seedGenerator();
  impl_->filter.resetUniformFreeSpace(grid.get(), 0.7, n);
  impl_->restart();
}

bool ParticleLocalizer::initialised() const { return impl_->initialised; }

void ParticleLocalizer::process(const WheelOdometry& odometry) {
  impl_->T_update_now = compose(impl_->T_update_now, odometry.T_previous_now);
}

ScanReport ParticleLocalizer::process(const LaserScan& scan) {
  assert(initialised());
  Impl& s = *impl_;
  BeamEnds beams = chooseBeams(scan, s.params.field);
  const bool moved = translationNorm(s.T_update_now) >= s.params.update_min_d_m ||
                     std::abs(s.T_update_now.phi) >= s.params.update_min_a_rad;
  const double since_update_s = std::abs(toSeconds(scan.stamp - s.last_update));
  s.report.used = beams.size() >= kMinBeams &&
                  (s.first_scan || moved || since_update_s >= s.params.update_max_s);
  if (s.report.used) {
    s.updateParticles(std::move(beams));
    s.last_update = scan.stamp;
  }

  const Pose2 T_map_base = s.pose().mean;
  s.report.inlier_share = inlierShare(
      scan, T_map_base, s.field, s.params.inlier_distance_m, s.params.field.max_range_m);
  const double dt_s = std::abs(toSeconds(scan.stamp - s.last_scan));
  const double keep = s.first_scan ? 0.0 : std::exp(-dt_s / s.params.trust_time_constant_s);
  s.report.trust = keep * s.report.trust + (1.0 - keep) * s.report.inlier_share;
  s.report.trusted = s.report.trust >= s.params.lost_inlier_share;
  s.last_scan = scan.stamp;
  if (s.report.used) s.first_scan = false;

  if (s.observers != nullptr) {
    if (s.report.used) s.emitParticles(scan.stamp);
    PoseEvent event;
    event.stamp = scan.stamp;
    event.source = PoseSource::kParticles;
    event.mode = Mode::kIndoor;
    event.T = s.pose();
    s.observers->emit(event);
  }
  return s.report;
}

PoseWithCovariance ParticleLocalizer::pose() const {
  assert(initialised());
  return impl_->pose();
}

const ScanReport& ParticleLocalizer::lastReport() const { return impl_->report; }

const grid::OccupancyMap& ParticleLocalizer::map() const { return *impl_->map; }

}  // namespace vestibule::amcl
