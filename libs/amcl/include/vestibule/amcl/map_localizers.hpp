#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/amcl/particle_localizer.hpp"

namespace vestibule::amcl {

/// Localization in the several maps of a site, of which one is at work at a time. Maps come and go
/// while the robot drives. What has been learnt of a map stays under its name until the robot is
/// back, whether or not the map is in memory meanwhile.
class MapLocalizers {
 public:
  /// \param observers may be null; receives what ParticleLocalizer emits and a PoseEvent per scan
  MapLocalizers(const AmclParams& params, std::uint64_t seed, const Observers* observers = nullptr);
  ~MapLocalizers();

  /// Adds a map, in the frame that all maps share. One of the same name is replaced.
  void load(const std::string& name, std::shared_ptr<const grid::OccupancyMap> map);
  /// Frees a map with its particles and search fields; the one at work stops. No such map: nothing
  /// happens.
  void unload(const std::string& name);
  [[nodiscard]] std::vector<std::string> names() const;  ///< in the order they were loaded

  /// Puts to work the map that the pose lies in, or the nearest one, and starts it there: with the
  /// next scan the particles are drawn at the places that a search about the pose finds, each by
  /// how it fits, and half of them from the pose itself, should the true place not be among them.
  /// \return false without any map
  bool seed(const PoseWithCovariance& T_map_base);
  /// None at work.
  void rest();
  /// The map at work; empty = none.
  [[nodiscard]] std::optional<std::string> atWork() const;

  void process(const WheelOdometry& odometry, YawSource yaw_source = YawSource::kWheels);
  /// \return empty with no map at work
  std::optional<ScanReport> process(const LaserScan& scan);
  void process(const Point2& p_map_base, double sigma_m);
  /// Empty with no map at work, and until the first scan after seed().
  [[nodiscard]] std::optional<PoseWithCovariance> pose() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vestibule::amcl
