#pragma once

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "vestibule/amcl/global_params.hpp"
#include "vestibule/core/frames.hpp"
#include "vestibule/grid/branch_and_bound.hpp"
#include "vestibule/grid/distance_field.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::amcl {

/// What is known about the place.
enum class PlaceState {
  kNowhere,  ///< no place in the map fits the scans
  kUnsure,   ///< one or more do, but it is too early or too equal to say which
  kSure      ///< one place fits, and no other does
};
[[nodiscard]] std::string_view toString(PlaceState state);

/// What a sensor tells of the pose on the way.
enum class PriorKind { kPosition, kHeading };

/// A place and how it fits.
struct Place {
  PoseWithCovariance T_map_base;
  double weight = 0.0;         ///< among all places; they sum to 1
  double inlier_share = 0.0;   ///< of the beams of all scans so far, [0, 1]
  double blocked_share = 0.0;  ///< of beams that pass through what is mapped
  double known_share = 1.0;    ///< of beams that end where the map knows something; of fitAt() only
};

/// Where the robot is in a map, from scans and odometry alone or with a prior: searches the whole
/// map (grid::BranchAndBoundMatcher), refines every place found on the distance field, and weighs
/// them all with every scan since, by ends and by free space, until one is left. New searches on
/// what has been seen meanwhile make sure that the right place is among them.
/// Several equal places stay several: kUnsure is an answer. Deterministic for any thread count.
class GlobalLocalizer {
 public:
  /// \param distances of the map, to share; made when null
  GlobalLocalizer(
      const GlobalParams& params,
      std::shared_ptr<const grid::OccupancyMap> map,
      std::shared_ptr<const grid::DistanceField> distances = nullptr);
  ~GlobalLocalizer();

  /// Forgets everything. \param prior what is known of the robot's present pose (GNSS, compass,
  /// last pose): places lose exp(-min(d^2, max_d2) / 2) of their weight, so the prior decides
  /// between equal places and cannot hide one that fits much better.
  /// \param zone where to search; empty = the whole map
  void start(
      const std::optional<grid::PosePrior>& prior = {},
      const std::optional<grid::SearchWindow>& zone = {});

  /// What a sensor (GNSS, compass) says of the present pose, as start()'s prior, from the next scan
  /// that counts on. Readings of one kind err alike: together they cost a place what they do on
  /// average, each by how sharp it is and, after some way by odometry, still is. Of readings at one
  /// place (key_distance_m) the sharpest counts, of equal ones the newest.
  /// \param prior       about x and y alone, or about the yaw alone, as `kind` says
  /// \param T_base_sensor of what the prior speaks of: the antenna
  /// \return whether it counts; what is not a number does not
  bool learn(PriorKind kind, const grid::PosePrior& prior, const Pose2& T_base_sensor = {});

  void process(const WheelOdometry& odometry);
  /// \return true if the scan counted (the first, then after enough motion)
  bool process(const LaserScan& scan);

  /// Holds the scans that counted against a place, whether or not a search has found it.
  void suggest(const Pose2& T_map_base);

  [[nodiscard]] PlaceState state() const;
  /// Best first, at the present odometry.
  [[nodiscard]] std::vector<Place> places() const;
  /// How a scan fits at a pose, whatever the search says.
  [[nodiscard]] Place fitAt(const LaserScan& scan, const Pose2& T_map_base) const;
  [[nodiscard]] double travelled() const;  ///< [m] since start
  [[nodiscard]] int searches() const;      ///< since start
  [[nodiscard]] const grid::OccupancyMap& map() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vestibule::amcl
