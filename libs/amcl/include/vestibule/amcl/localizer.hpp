#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "vestibule/amcl/global_localizer.hpp"
#include "vestibule/amcl/params.hpp"
#include "vestibule/amcl/particle_localizer.hpp"

namespace vestibule::amcl {

/// Localization in a prior map that knows whether it knows: the particles track a known pose; when
/// there is none, or when the scans have not fitted it for a while, GlobalLocalizer searches until
/// one place is left and hands it to the particles. The particles go on meanwhile: a crowd that has
/// passed needs no search. For a robot that has nothing but the map; with GNSS the mode manager
/// seeds the particles.
class Localizer {
 public:
  /// \param observers may be null; receives what ParticleLocalizer emits, a PoseEvent per scan,
  ///   which is lost while it is not trusted, a PlacesEvent per scan that counts in a search, and a
  ///   WarningEvent when a search begins
  Localizer(
      const AmclParams& params,
      std::shared_ptr<const grid::OccupancyMap> map,
      std::uint64_t seed,
      const Observers* observers = nullptr);
  ~Localizer();

  void startAt(const PoseWithCovariance& T_map_base);
  /// \param prior what is known all the same (GNSS, compass, last pose)
  /// \param zone where the robot is; empty = anywhere in the map
  void startAnywhere(
      const std::optional<grid::PosePrior>& prior = {},
      const std::optional<grid::SearchWindow>& zone = {});

  void process(const WheelOdometry& odometry, YawSource yaw_source = YawSource::kWheels);
  /// What a sensor says of the present pose (GlobalLocalizer::learn), for the search that runs. One
  /// that begins later asks anew: the robot may have been carried since.
  /// \return whether a search takes it in
  bool learn(PriorKind kind, const grid::PosePrior& prior, const Pose2& T_base_sensor = {});
  /// Weighs the particles by a position (ParticleLocalizer::process) while they track.
  void process(const Point2& p_map_base, double sigma_m);
  /// \pre started. While searching the report is not trusted and has the pose and the shares of the
  /// best place.
  ScanReport process(const LaserScan& scan);

  /// Not sure where the robot is: pose() is the likeliest place and may be wrong.
  [[nodiscard]] bool searching() const;
  [[nodiscard]] PlaceState state() const;  ///< kSure while the particles track
  /// The candidates, best first; one with weight 1 while the particles track.
  [[nodiscard]] std::vector<Place> places() const;
  /// While searching its covariance covers all candidates.
  [[nodiscard]] PoseWithCovariance pose() const;
  [[nodiscard]] int recoveries() const;  ///< searches because the scans did not fit
  [[nodiscard]] int searches() const;    ///< of the map, all together

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vestibule::amcl
