#include "vestibule/amcl/map_localizers.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "vestibule/amcl/global_localizer.hpp"

namespace vestibule::amcl {
namespace {

// The search about a pose covers so many sigmas of it, and at least as much as a careful guess
// needs.
constexpr double kWindowSigmas = 3.0;
constexpr double kMinHalf_m = 0.5;
constexpr double kMinHalf_rad = degToRad(10.0);
// The share of the particles that is drawn from the pose itself.
constexpr double kFromPose = 0.5;
// Places with less of the weight are not worth particles.
constexpr double kWorthParticles = 0.02;
// The particles begin about a place that was found with at least this spread.
constexpr double kSeedSigma_m = 0.08;
constexpr double kSeedSigma_rad = degToRad(1.5);

struct One {
  std::string name;
  std::shared_ptr<const grid::OccupancyMap> map;
  // Made when the robot first comes near.
  std::unique_ptr<ParticleLocalizer> particles;
  std::unique_ptr<GlobalLocalizer> search;
};

grid::SearchWindow windowAbout(const PoseWithCovariance& T) {
  // A square about the ellipse, however map and grid are turned against each other.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(T.cov.topLeftCorner<2, 2>());
  const double sigma_m = std::sqrt(axes.eigenvalues().y());
  grid::SearchWindow window;
  window.T_map_centre = T.mean;
  window.half_x_m = window.half_y_m = std::max(kMinHalf_m, kWindowSigmas * sigma_m);
  window.half_yaw_rad =
      std::min(kPi, std::max(kMinHalf_rad, kWindowSigmas * std::sqrt(T.cov(2, 2))));
  return window;
}

}  // namespace

struct MapLocalizers::Impl {
  AmclParams params;
  std::uint64_t seed;
  const Observers* observers;
  std::vector<One> all;
  std::map<std::string, LearntOfMap> learnt;  // of maps that were unloaded, by name
  std::optional<std::size_t> at_work;
  std::optional<PoseWithCovariance> wanted;  // where to start with the next scan

  [[nodiscard]] std::vector<One>::iterator find(const std::string& name) {
    return std::find_if(all.begin(), all.end(), [&](const One& one) { return one.name == name; });
  }

  /// Modes of a search about the wanted pose, and the pose itself.
  [[nodiscard]] std::vector<PoseMode> modes(One& one, const LaserScan& scan) const {
    grid::PosePrior prior;
    prior.T_map_base = wanted->mean;
    prior.information = wanted->cov.inverse();
    prior.max_d2 = kWindowSigmas * kWindowSigmas;
    one.search->start(prior, windowAbout(*wanted));
    one.search->process(scan);
    std::vector<PoseMode> modes{{*wanted, kFromPose}};
    for (const Place& place : one.search->places()) {
      if (place.weight < kWorthParticles) break;
      PoseMode mode{place.T_map_base, (1.0 - kFromPose) * place.weight};
      mode.T_map_base.cov += Eigen::Vector3d(
                                 kSeedSigma_m * kSeedSigma_m,
                                 kSeedSigma_m * kSeedSigma_m,
                                 kSeedSigma_rad * kSeedSigma_rad)
                                 .asDiagonal();
      modes.push_back(mode);
    }
    return modes;
  }
};

MapLocalizers::MapLocalizers(
    const AmclParams& params, std::uint64_t seed, const Observers* observers)
    : impl_(std::make_unique<Impl>(Impl{params, seed, observers, {}, {}, {}, {}})) {}

MapLocalizers::~MapLocalizers() = default;

void MapLocalizers::load(const std::string& name, std::shared_ptr<const grid::OccupancyMap> map) {
  unload(name);
  impl_->all.push_back({name, std::move(map), nullptr, nullptr});
}

void MapLocalizers::unload(const std::string& name) {
  const auto it = impl_->find(name);
  if (it == impl_->all.end()) return;
  const auto index = static_cast<std::size_t>(it - impl_->all.begin());
  if (impl_->at_work == index) rest();
  if (impl_->at_work && *impl_->at_work > index) --*impl_->at_work;
  if (it->particles) impl_->learnt[name] = it->particles->learnt();
  impl_->all.erase(it);
}

std::vector<std::string> MapLocalizers::names() const {
  std::vector<std::string> names;
  for (const One& one : impl_->all) names.push_back(one.name);
  return names;
}

bool MapLocalizers::seed(const PoseWithCovariance& T_map_base) {
  if (impl_->all.empty()) return false;
  const Point2 p{T_map_base.mean.x, T_map_base.mean.y};
  const auto nearest =
      std::min_element(impl_->all.begin(), impl_->all.end(), [&](const One& a, const One& b) {
        const grid::MapRectangle rect_a = a.map->rectangle();
        const grid::MapRectangle rect_b = b.map->rectangle();
        const double a_m = rect_a.outside(p);
        const double b_m = rect_b.outside(p);
        return a_m != b_m ? a_m < b_m : rect_a.fromCentre(p) < rect_b.fromCentre(p);
      });
  if (!nearest->particles) {
    nearest->particles = std::make_unique<ParticleLocalizer>(
        impl_->params, nearest->map, impl_->seed, impl_->observers, impl_->learnt[nearest->name]);
    nearest->search = std::make_unique<GlobalLocalizer>(
        impl_->params.global, nearest->map, nearest->particles->distances());
  }
  impl_->at_work = static_cast<std::size_t>(nearest - impl_->all.begin());
  impl_->wanted = T_map_base;
  return true;
}

void MapLocalizers::rest() {
  impl_->at_work.reset();
  impl_->wanted.reset();
}

std::optional<std::string> MapLocalizers::atWork() const {
  if (!impl_->at_work) return std::nullopt;
  return impl_->all[*impl_->at_work].name;
}

void MapLocalizers::process(const WheelOdometry& odometry, YawSource yaw_source) {
  if (!impl_->at_work) return;
  impl_->all[*impl_->at_work].particles->process(odometry, yaw_source);
  if (impl_->wanted) impl_->wanted = compose(*impl_->wanted, odometry.T_previous_now);
}

std::optional<ScanReport> MapLocalizers::process(const LaserScan& scan) {
  if (!impl_->at_work) return std::nullopt;
  One& one = impl_->all[*impl_->at_work];
  if (impl_->wanted) {
    one.particles->initialise(impl_->modes(one, scan));
    impl_->wanted.reset();
  }
  const ScanReport report = one.particles->process(scan);
  if (impl_->observers != nullptr) {
    PoseEvent event;
    event.stamp = scan.stamp;
    event.source = PoseSource::kParticles;
    event.mode = Mode::kIndoor;
    event.T = report.T_map_base;
    impl_->observers->emit(event);
  }
  return report;
}

void MapLocalizers::process(const Point2& p_map_base, double sigma_m) {
  if (!impl_->at_work || impl_->wanted) return;
  impl_->all[*impl_->at_work].particles->process(p_map_base, sigma_m);
}

std::optional<PoseWithCovariance> MapLocalizers::pose() const {
  if (!impl_->at_work || impl_->wanted) return std::nullopt;
  return impl_->all[*impl_->at_work].particles->pose();
}

}  // namespace vestibule::amcl
