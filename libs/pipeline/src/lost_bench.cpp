#include "vestibule/pipeline/lost_bench.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/amcl/particle_localizer.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/ekf/filter.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/sim/scenario.hpp"

namespace vestibule::pipeline {
namespace {

constexpr double kLost_m = 0.5;
constexpr double kLost_rad = degToRad(10.0);
constexpr Duration kTick = std::chrono::milliseconds(20);
constexpr double kSamplePeriod_s = 1.0;
constexpr int kTroubles = 5;

/// The same cells mirrored left to right: as much like the building as a wrong map can be.
grid::OccupancyMap mirrored(const grid::OccupancyMap& map) {
  std::vector<grid::Cell> cells;
  cells.reserve(static_cast<std::size_t>(map.width()) * static_cast<std::size_t>(map.height()));
  for (int iy = 0; iy < map.height(); ++iy) {
    for (int ix = map.width() - 1; ix >= 0; --ix) cells.push_back(map.cell(ix, iy));
  }
  const Pose2 T_map_corner = compose(map.T_map_grid(), Pose2{map.corner().x, map.corner().y, 0.0});
  return grid::OccupancyMap::fromCells(
      map.width(), map.height(), map.resolution(), {0.0, 0.0}, cells, T_map_corner);
}

/// A point of the scenario's way, at least `away_m` from `from`, facing anywhere.
Pose2 elsewhere(
    const sim::Scenario& scenario, const Pose2& from, double away_m, RandomStream& rng) {
  std::vector<Point2> way{{scenario.T_map_base_start.x, scenario.T_map_base_start.y}};
  for (const sim::Leg& leg : scenario.drive) {
    if (leg.to) way.push_back(*leg.to);
  }
  Pose2 place = from;
  for (int tries = 0; tries < 100; ++tries) {
    const auto leg = static_cast<std::size_t>(
        rng.uniform() * static_cast<double>(std::max<std::size_t>(1, way.size() - 1)));
    const std::size_t next = std::min(leg + 1, way.size() - 1);
    const double s = rng.uniform();
    place = {
        way[leg].x + s * (way[next].x - way[leg].x),
        way[leg].y + s * (way[next].y - way[leg].y),
        rng.uniform(-kPi, kPi)};
    if (distance(place, from) >= away_m) break;
  }
  return place;
}

class Drive {
 public:
  Drive(
      const sim::Scenario& scenario,
      const grid::OccupancyMap& map,
      int number,
      const Config& config)
      : scenario_(scenario),
        trouble_(static_cast<Trouble>(number % kTroubles)),
        rng_(config.seed, "lost-bench", static_cast<std::uint64_t>(number)),
        odometry_(config.ekf, config.rig) {
    if (trouble_ == Trouble::kCrowd) scenario_.sim.lidar.occlusion = rng_.uniform(0.2, 0.75);
    kidnap_at_s_ = rng_.uniform(5.0, 60.0);
    const bool wrong_map = trouble_ == Trouble::kWrongMap;
    localizer_.emplace(
        config.amcl,
        std::make_shared<const grid::OccupancyMap>(wrong_map ? mirrored(map) : map),
        derivedSeed(config.seed, "lost-bench", static_cast<std::uint64_t>(number)));
    run_.emplace(
        scenario_, derivedSeed(config.seed, "lost-sim", static_cast<std::uint64_t>(number)));
    Pose2 told = scenario.T_map_base_start;
    if (trouble_ == Trouble::kWrongStart) {
      // From hardly wrong to another room.
      told =
          compose(told, Pose2{rng_.normal(0.0, 1.5), rng_.normal(0.0, 0.7), rng_.normal(0.0, 0.5)});
    }
    constexpr double kSigma_m = 0.25;
    constexpr double kSigma_rad = degToRad(5.0);
    localizer_->initialise(
        {told,
         Eigen::Vector3d(kSigma_m * kSigma_m, kSigma_m * kSigma_m, kSigma_rad * kSigma_rad)
             .asDiagonal()});
  }

  void drive(std::vector<LostSample>& samples) {
    double next_sample_s = kSamplePeriod_s;
    while (!run_->finished()) {
      if (trouble_ == Trouble::kKidnap && !kidnapped_ && run_->elapsed() >= kidnap_at_s_) {
        kidnapped_ = true;
        constexpr double kAway_m = 3.0;
        run_->simulator().carryTo(elsewhere(scenario_, run_->simulator().truth(), kAway_m, rng_));
      }
      for (const sim::Delivered& delivered : run_->step(kTick)) take(delivered.measurement);
      if (run_->elapsed() >= next_sample_s && seen_scan_) {
        next_sample_s += kSamplePeriod_s;
        sample(samples);
      }
    }
  }

 private:
  void take(const Measurement& measurement) {
    if (const auto* wheels = std::get_if<WheelOdometry>(&measurement)) {
      odometry_.process(*wheels);
      WheelOdometry increment = *wheels;
      const Pose2 now = odometry_.odometry().mean;
      increment.T_previous_now = between(T_odom_base_, now);
      T_odom_base_ = now;
      localizer_->process(increment, amcl::YawSource::kGyro);
    } else if (const auto* imu = std::get_if<Imu>(&measurement)) {
      odometry_.process(*imu);
    } else if (const auto* scan = std::get_if<LaserScan>(&measurement)) {
      (void)localizer_->process(*scan);
      seen_scan_ = true;
    }
  }

  void sample(std::vector<LostSample>& samples) const {
    const Pose2 truth = run_->simulator().truth();
    const Pose2 estimate = localizer_->pose().mean;
    LostSample sample;
    sample.trouble = trouble_;
    sample.evidence = localizer_->lastReport().evidence;
    sample.probability = localizer_->lastReport().lost_probability;
    sample.lost = distance(truth, estimate) > kLost_m ||
                  std::abs(angleDiff(truth.phi, estimate.phi)) > kLost_rad;
    samples.push_back(sample);
  }

  sim::Scenario scenario_;
  Trouble trouble_;
  RandomStream rng_;
  ekf::MapFilter odometry_;
  Pose2 T_odom_base_;
  std::optional<amcl::ParticleLocalizer> localizer_;
  std::optional<sim::ScenarioRun> run_;
  double kidnap_at_s_ = 0.0;
  bool kidnapped_ = false;
  bool seen_scan_ = false;
};

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
    const std::string& scenario_name,
    const std::string& scenario_folder,
    int drives,
    const Config& config,
    const Progress& progress) {
  const sim::Scenario scenario = sim::loadScenario(scenario_name, scenario_folder);
  if (!scenario.site_path || scenario.world.given_maps.empty()) {
    throw ConfigError(
        "scenario " + scenario_name + " has no site with a given map; take office_nominal");
  }
  const geo::Site site = geo::loadSite(*scenario.site_path);
  const auto map = io::loadMap(site.indoor_maps.at(0).yaml_path)
                       .movedBy(scenario.world.given_maps.at(0).T_map_grid);
  std::vector<LostSample> samples;
  for (int i = 0; i < drives; ++i) {
    Drive(scenario, map, i, config).drive(samples);
    progress(static_cast<double>(i + 1) / drives, static_cast<double>(samples.size()));
  }
  return samples;
}

Reliability reliabilityOf(const std::vector<LostSample>& samples, int bins) {
  Reliability result;
  result.bins.resize(static_cast<std::size_t>(bins));
  for (const LostSample& s : samples) {
    const auto b = std::min(bins - 1, static_cast<int>(s.probability * bins));
    Reliability::Bin& bin = result.bins[static_cast<std::size_t>(b)];
    ++bin.samples;
    bin.mean_probability += s.probability;
    bin.lost_share += s.lost ? 1.0 : 0.0;
    result.lost_share += s.lost ? 1.0 : 0.0;
    const double miss = s.probability - (s.lost ? 1.0 : 0.0);
    result.brier_score += miss * miss;
  }
  const auto n = std::max<double>(1.0, static_cast<double>(samples.size()));
  for (Reliability::Bin& bin : result.bins) {
    if (bin.samples == 0) continue;
    const auto count = static_cast<double>(bin.samples);
    bin.mean_probability /= count;
    bin.lost_share /= count;
    result.expected_calibration_error +=
        count / n * std::abs(bin.mean_probability - bin.lost_share);
  }
  result.lost_share /= n;
  result.brier_score /= n;
  return result;
}

}  // namespace vestibule::pipeline
