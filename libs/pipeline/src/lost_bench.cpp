#include "vestibule/pipeline/lost_bench.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "trials.hpp"
#include "vestibule/amcl/particle_localizer.hpp"
#include "vestibule/core/random.hpp"
#include "wanderer.hpp"

namespace vestibule::pipeline {
namespace {

constexpr double kLost_m = 0.5;
constexpr double kLost_rad = degToRad(10.0);
constexpr double kDriven_m = 40.0;
constexpr int kMaxTicks = 2000;
constexpr int kTicksPerScan = 2;
constexpr int kTicksPerSample = 10;
constexpr int kTroubles = 5;

/// The building with left and right swapped, as a robot at this pose sees them: as much like it as
/// a wrong map can be.
grid::OccupancyMap mirroredAbout(const grid::OccupancyMap& map, const Pose2& T_map_base) {
  std::vector<grid::Cell> cells;
  cells.reserve(static_cast<std::size_t>(map.width()) * static_cast<std::size_t>(map.height()));
  for (int iy = map.height() - 1; iy >= 0; --iy) {
    for (int ix = 0; ix < map.width(); ++ix) cells.push_back(map.cell(ix, iy));
  }
  const Point2 corner{map.corner().x, -map.corner().y - map.height() * map.resolution()};
  const Pose2 T_grid_base = between(map.T_map_grid(), T_map_base);
  const Pose2 T_mirrored_base{T_grid_base.x, -T_grid_base.y, -T_grid_base.phi};
  return grid::OccupancyMap::fromCells(
      map.width(),
      map.height(),
      map.resolution(),
      corner,
      cells,
      compose(T_map_base, inverse(T_mirrored_base)));
}

/// People around the robot: they hide sectors of the view, and walk on now and then.
class Crowd {
 public:
  Crowd(double hidden_share, const RandomStream& rng) : hidden_share_(hidden_share), rng_(rng) {}

  void hideIn(LaserScan& scan) {
    constexpr double kChange = 0.1;  // of the sectors, per scan
    constexpr double kSector_rad = 0.17;
    constexpr double kNear_m = 0.5;
    constexpr double kFar_m = 2.5;
    constexpr double kNoise_m = 0.03;
    const auto sectors = static_cast<std::size_t>(2.0 * kPi / kSector_rad) + 1;
    if (away_m_.empty()) away_m_.assign(sectors, -1.0);
    for (double& away_m : away_m_) {
      const bool changes = away_m < 0.0 || rng_.bernoulli(kChange);
      if (changes) away_m = rng_.bernoulli(hidden_share_) ? rng_.uniform(kNear_m, kFar_m) : 0.0;
    }
    for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
      const double angle = wrapToPi(scan.angle(i)) + kPi;
      const double away_m = away_m_[static_cast<std::size_t>(angle / kSector_rad) % sectors];
      if (away_m <= 0.0 || static_cast<double>(scan.ranges_m[i]) < away_m) continue;
      scan.ranges_m[i] = static_cast<float>(away_m + rng_.normal(0.0, kNoise_m));
    }
  }

 private:
  double hidden_share_;
  RandomStream rng_;
  std::vector<double> away_m_;  // per sector; 0 = nobody
};

std::vector<LostSample> wanderLost(
    const LostPlace& place,
    const Ground& ground,
    const amcl::AmclParams& params,
    int number,
    std::uint64_t seed) {
  const auto trial = static_cast<std::uint64_t>(number);
  RandomStream rng(seed, "lost-bench", trial);
  const auto trouble = static_cast<Trouble>(number % kTroubles);
  Wanderer robot(place, ground, ground.draw(rng), RandomStream(seed, "lost-wanderer", trial));
  Crowd crowd(
      trouble == Trouble::kCrowd ? rng.uniform(0.2, 0.75) : 0.0,
      RandomStream(seed, "lost-crowd", trial));
  const double kidnap_at_m =
      trouble == Trouble::kKidnap ? rng.uniform(2.0, 0.5 * kDriven_m) : 2.0 * kDriven_m;
  auto map = place.map;
  Pose2 told = robot.truth();
  if (trouble == Trouble::kWrongMap) {
    map = std::make_shared<const grid::OccupancyMap>(mirroredAbout(*map, told));
  } else if (trouble == Trouble::kWrongStart) {
    // From hardly wrong to another room.
    told = compose(told, Pose2{rng.normal(0.0, 1.5), rng.normal(0.0, 0.7), rng.normal(0.0, 0.5)});
  }
  amcl::ParticleLocalizer localizer(params, map, derivedSeed(seed, "lost-bench", trial));
  constexpr double kSigma_m = 0.25;
  constexpr double kSigma_rad = degToRad(5.0);
  localizer.initialise(
      {told,
       Eigen::Vector3d(kSigma_m * kSigma_m, kSigma_m * kSigma_m, kSigma_rad * kSigma_rad)
           .asDiagonal()});

  std::vector<LostSample> samples;
  bool kidnapped = false;
  for (int tick = 1; tick <= kMaxTicks && robot.driven() < kDriven_m; ++tick) {
    if (!kidnapped && robot.driven() >= kidnap_at_m) {
      kidnapped = true;
      constexpr double kAway_m = 3.0;
      constexpr int kTries = 100;
      Pose2 elsewhere = ground.draw(rng);
      for (int i = 0; i < kTries && distance(elsewhere, robot.truth()) < kAway_m; ++i) {
        elsewhere = ground.draw(rng);
      }
      robot.carryTo(elsewhere);
    }
    localizer.process(robot.drive());
    if (tick % kTicksPerScan != 0) continue;
    LaserScan scan = robot.scan();
    crowd.hideIn(scan);
    const amcl::ScanReport report = localizer.process(scan);
    if (tick % kTicksPerSample != 0) continue;
    LostSample sample;
    sample.drive = number;
    sample.driven_m = robot.driven();
    sample.trouble = trouble;
    sample.evidence = report.evidence;
    sample.probability = report.lost_probability;
    const Pose2 estimate = localizer.pose().mean;
    sample.error_m = distance(robot.truth(), estimate);
    sample.error_rad = std::abs(angleDiff(robot.truth().phi, estimate.phi));
    sample.lost = sample.error_m > kLost_m || sample.error_rad > kLost_rad;
    samples.push_back(sample);
  }
  return samples;
}

}  // namespace

std::string_view toString(Trouble trouble) {
  switch (trouble) {
    case Trouble::kNone:
      return "none";
    case Trouble::kCrowd:
      return "crowd";
    case Trouble::kKidnap:
      return "kidnap";
    case Trouble::kWrongStart:
      return "wrong start";
    case Trouble::kWrongMap:
      return "wrong map";
  }
  return "";
}

std::vector<LostSample> sampleLost(
    const LostPlace& place,
    const Config& config,
    int drives,
    std::uint64_t seed,
    const Progress& progress) {
  const Ground ground(place);
  amcl::AmclParams params = config.amcl;
  const std::size_t workers = threadCount(params.global.search.threads);
  std::vector<std::vector<LostSample>> by_drive(static_cast<std::size_t>(drives));
  runTrials(by_drive.size(), workers, progress, [&](std::size_t i, std::size_t) {
    by_drive[i] = wanderLost(place, ground, params, static_cast<int>(i), seed);
  });
  std::vector<LostSample> samples;
  for (const auto& drive : by_drive) samples.insert(samples.end(), drive.begin(), drive.end());
  return samples;
}

Reliability reliabilityOf(const std::vector<std::vector<LostSample>>& places, int bins) {
  Reliability result;
  result.bins.resize(static_cast<std::size_t>(bins));
  for (const auto& samples : places) {
    const double weight =
        1.0 / (static_cast<double>(places.size()) * static_cast<double>(samples.size()));
    for (const LostSample& s : samples) {
      const auto b = std::min(bins - 1, static_cast<int>(s.probability * bins));
      Reliability::Bin& bin = result.bins[static_cast<std::size_t>(b)];
      const double lost = s.lost ? 1.0 : 0.0;
      bin.weight += weight;
      bin.mean_probability += weight * s.probability;
      bin.lost_share += weight * lost;
      result.lost_share += weight * lost;
      result.brier_score += weight * (s.probability - lost) * (s.probability - lost);
    }
  }
  for (Reliability::Bin& bin : result.bins) {
    if (bin.weight == 0.0) continue;
    result.expected_calibration_error += std::abs(bin.mean_probability - bin.lost_share);
    bin.mean_probability /= bin.weight;
    bin.lost_share /= bin.weight;
  }
  const double of_mean = result.lost_share * (1.0 - result.lost_share);
  if (of_mean > 0.0) result.skill = 1.0 - result.brier_score / of_mean;
  return result;
}

amcl::LostFeatures fitLostModel(const std::vector<std::vector<LostSample>>& places) {
  constexpr int kSteps = 30;
  constexpr double kPull = 1e-4;
  using Hessian = Eigen::
      Matrix<double, amcl::LostFeatures::RowsAtCompileTime, amcl::LostFeatures::RowsAtCompileTime>;
  amcl::LostFeatures weights = amcl::LostFeatures::Zero();
  for (int step = 0; step < kSteps; ++step) {
    Hessian H = kPull * Hessian::Identity();
    amcl::LostFeatures g = -kPull * weights;
    for (const auto& samples : places) {
      const double share =
          1.0 / (static_cast<double>(places.size()) * static_cast<double>(samples.size()));
      for (const LostSample& s : samples) {
        const amcl::LostFeatures f = amcl::lostFeatures(s.evidence);
        const double p = amcl::lostProbability(weights, f);
        g += share * ((s.lost ? 1.0 : 0.0) - p) * f;
        H += share * p * (1.0 - p) * f * f.transpose();
      }
    }
    weights += H.ldlt().solve(g);
  }
  return weights;
}

std::vector<std::vector<LostSample>> judgedByOthers(std::vector<std::vector<LostSample>> places) {
  const std::vector<std::vector<LostSample>> measured = places;
  for (std::size_t i = 0; i < places.size(); ++i) {
    auto others = measured;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const amcl::LostFeatures weights = fitLostModel(others);
    for (LostSample& s : places[i]) {
      s.probability = amcl::lostProbability(weights, amcl::lostFeatures(s.evidence));
    }
  }
  return places;
}

}  // namespace vestibule::pipeline
