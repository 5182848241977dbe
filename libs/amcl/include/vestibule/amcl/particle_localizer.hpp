#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "vestibule/amcl/lost_model.hpp"
#include "vestibule/amcl/params.hpp"
#include "vestibule/core/events.hpp"
#include "vestibule/grid/distance_field.hpp"
#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::amcl {

/// What a scan did, and how far the pose can be trusted.
struct ScanReport {
  bool used = false;          ///< false: too little motion since the last used scan, or no beams
  std::string unused_reason;  ///< "", "too little motion", "too few beams", ...
  PoseWithCovariance T_map_base;  ///< at the scan's stamp
  double inlier_share = 0.0;      ///< of this scan's beams at the estimated pose, [0, 1]
  double trust = 0.0;             ///< smoothed inlier share, [0, 1]
  bool trusted = false;           ///< trust is above AmclParams::lost_inlier_share
  /// Calibrated probability that the true pose is farther than 0.5 m or 10 degrees from this one
  /// (amcl/lost_model.hpp).
  double lost_probability = 0.0;
  LostEvidence evidence;
  std::size_t particles = 0;
  double effective_sample_size = 0.0;
  std::size_t beams = 0;          ///< weighed
  std::size_t beams_skipped = 0;  ///< of the chosen ones: on things that are not in the map
};

/// One place where the robot may be. Weights of several need not sum to one.
struct PoseMode {
  PoseWithCovariance T_map_base;
  double weight = 1.0;
};

/// What driving in a map teaches of it, and what a new start in it keeps. All else comes from the
/// map's cells or from where the robot is.
struct LearntOfMap {
  /// Of surfaces in front of the middle of their cells (refinement.hpp).
  double wall_offset_m = 0.0;
  double wall_offset_var_m2 = 0.03 * 0.03;  ///< before anything is known
  std::uint64_t draws = 0;                  ///< of random numbers so far: none is used twice
};

/// Who measured the turn of an odometry increment.
enum class YawSource { kWheels, kGyro };

/// Monte-Carlo localization in a prior map: MRPT's particle filter (CParticleFilter over a
/// CParticleFilterCapable set) on kernels of our own, with KLD-adaptive sample size, and a
/// Gauss-Newton refinement of the likeliest place on the distance field.
///
/// Every random number comes from (seed, number of the update, particle): the same input gives the
/// same particles for any number of threads and with or without vector instructions.
/// Not thread-safe; one instance per robot and map.
class ParticleLocalizer {
 public:
  /// \param map in the frame the poses shall be in; shared, never changed
  /// \param observers may be null; receives UpdateEvent, ParticlesEvent and WarningEvent; poses are
  ///   for the owner to tell, who knows whether they count
  /// \param learnt of this map by an earlier localizer
  ParticleLocalizer(
      const AmclParams& params,
      std::shared_ptr<const grid::OccupancyMap> map,
      std::uint64_t seed,
      const Observers* observers = nullptr,
      const LearntOfMap& learnt = {});
  ~ParticleLocalizer();

  /// Draws the particles from a Gaussian. May be called again at any time (seeding at a door).
  void initialise(const PoseWithCovariance& T_map_base);
  /// Draws the particles from several places, each with its share of the weight (a global search
  /// that found more than one). \pre not empty, weights not negative and at least one positive
  void initialise(const std::vector<PoseMode>& modes);
  /// Draws the particles uniformly from the free cells of the map.
  void initialiseGlobally();
  [[nodiscard]] bool initialised() const;

  /// \param yaw_source a gyro's turn is trusted more than the wheels'
  void process(const WheelOdometry& odometry, YawSource yaw_source = YawSource::kWheels);
  /// A scan counts at its own stamp, wherever in the last seconds' odometry that lies.
  /// \pre initialised()
  ScanReport process(const LaserScan& scan);

  /// Weighs the particles by a position (GNSS), where AmclParams::gnss says so.
  /// \param sigma_m of each axis, as the receiver or its filter claims
  void process(const Point2& p_map_base, double sigma_m);

  /// The likeliest place and its covariance, carried on to the latest odometry. While several
  /// places are likely the covariance spans them. \pre initialised()
  [[nodiscard]] PoseWithCovariance pose() const;
  /// All likely places with their shares of the weight, the likeliest first. \pre initialised()
  [[nodiscard]] std::vector<PoseMode> modes() const;
  [[nodiscard]] const ScanReport& lastReport() const;
  [[nodiscard]] const grid::OccupancyMap& map() const;
  [[nodiscard]] const LearntOfMap& learnt() const;
  /// Of the map, for others that need it, too.
  [[nodiscard]] std::shared_ptr<const grid::DistanceField> distances() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Throws InputError for a map without free or without occupied cells, in which nothing can be
/// localized. \param name of the map's file, for the message
void requireUsable(const grid::OccupancyMap& map, const std::string& name);

/// Share of the scan's valid beams (up to max_range_m) that end within inlier_distance_m of a
/// mapped obstacle at this pose; 0 when fewer than 10 beams are valid.
[[nodiscard]] double inlierShare(
    const LaserScan& scan,
    const Pose2& T_map_base,
    const grid::DistanceField& field,
    double inlier_distance_m,
    double max_range_m);

}  // namespace vestibule::amcl
