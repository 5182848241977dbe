#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "vestibule/amcl/params.hpp"
#include "vestibule/core/events.hpp"
#include "vestibule/grid/distance_field.hpp"
#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::amcl {

/// What a scan did, and how far the pose can be trusted.
struct ScanReport {
  bool used = false;          ///< false: too little motion since the last used scan
  double inlier_share = 0.0;  ///< of this scan's beams at the estimated pose, [0, 1]
  double trust = 0.0;         ///< smoothed inlier share, [0, 1]
  bool trusted = false;       ///< trust is above AmclParams::lost_inlier_share
  std::size_t particles = 0;
  double effective_sample_size = 0.0;
};

/// One place where the robot may be. Weights of several need not sum to one.
struct PoseMode {
  PoseWithCovariance T_map_base;
  double weight = 1.0;
};

/// Monte-Carlo localization in a prior map, on MRPT's CMonteCarloLocalization2D with KLD-adaptive
/// sample size. Every random number comes from (seed, number of the update): the same input gives
/// the same particles, whatever else draws from MRPT's generator in between.
/// Not thread-safe; one instance per robot and map.
class ParticleLocalizer {
 public:
  /// \param map in the frame the poses shall be in; shared, never changed
  /// \param observers may be null; receives UpdateEvent, ParticlesEvent and PoseEvent
  ParticleLocalizer(
      const AmclParams& params,
      std::shared_ptr<const grid::OccupancyMap> map,
      std::uint64_t seed,
      const Observers* observers = nullptr);
  ~ParticleLocalizer();

  /// Draws the particles from a Gaussian. May be called again at any time (seeding at a door).
  void initialise(const PoseWithCovariance& T_map_base);
  /// Draws the particles from several places, each with its share of the weight (a global search
  /// that found more than one). \pre not empty, weights not negative and at least one positive
  void initialise(const std::vector<PoseMode>& modes);
  /// Draws the particles uniformly from the free cells of the map.
  void initialiseGlobally();
  [[nodiscard]] bool initialised() const;

  void process(const WheelOdometry& odometry);
  /// \pre initialised()
  ScanReport process(const LaserScan& scan);

  /// Weighted mean and covariance of the particles, carried on by the odometry since the last used
  /// scan. \pre initialised()
  [[nodiscard]] PoseWithCovariance pose() const;
  [[nodiscard]] const ScanReport& lastReport() const;
  [[nodiscard]] const grid::OccupancyMap& map() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Share of the scan's valid beams (up to max_range_m) that end within inlier_distance_m of a
/// mapped obstacle at this pose; 0 when fewer than 10 beams are valid.
[[nodiscard]] double inlierShare(
    const LaserScan& scan,
    const Pose2& T_map_base,
    const grid::DistanceField& field,
    double inlier_distance_m,
    double max_range_m);

}  // namespace vestibule::amcl
