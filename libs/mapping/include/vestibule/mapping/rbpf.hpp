#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "vestibule/core/events.hpp"
#include "vestibule/mapping/params.hpp"
#include "vestibule/mapping/patch_map.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::mapping {

/// What a scan did to the filter.
struct MapReport {
  bool used = false;                 ///< false: too little motion since the last used scan
  double effective_particles = 0.0;  ///< before resampling
  bool resampled = false;
  double known_share = 0.0;  ///< of the scan's points in seen cells: on mapped obstacles
  bool slipped = false;      ///< the scan contradicts the odometry
  bool repeated = false;     ///< taken from an earlier run
};

/// One generation of particles: the outcome of one used scan. The sequence of generations is all
/// that is random about a run: with it and the recording, the filter is rebuilt.
struct Generation {
  std::size_t scan = 0;  ///< number of the scan, from 0
  MapReport report;
  std::vector<std::uint32_t> parents;  ///< per particle: its number in the generation before
  std::vector<Pose2> poses;            ///< T_map_base
  std::vector<double> log_weights;     ///< after resampling
  std::vector<double> scores;          ///< log-likelihood of the whole path
};

/// Rao-Blackwellised particle filter on occupancy maps (Grisetti, Stachniss, Burgard, T-RO 2007) on
/// MRPT's particle filter classes. Particles share what their maps have in common; the improved
/// proposal is the Gaussian of scan and odometry in closed form, so that directions in which the
/// scan says nothing (corridors) keep the odometry's spread.
/// The result does not depend on the number of threads. Not thread-safe itself.
class Rbpf {
 public:
  /// \param observers may be null; receives ParticlesEvent and WarningEvent
  Rbpf(const FilterParams& params, std::uint64_t seed, const Observers* observers = nullptr);
  Rbpf(const Rbpf&) = delete;
  Rbpf& operator=(const Rbpf&) = delete;
  ~Rbpf();

  /// Begins in a map that is there already, near this pose. \pre no scan yet
  void start(const Pose2& T_map_base, const PatchMap& map);
  /// Takes the outcome of the first updates from an earlier run over the same scans instead of
  /// computing it: what follows is the same to the bit. \pre no scan yet; as many particles
  void repeat(std::vector<Generation> generations);

  /// \param scan deskewed
  /// \param T_odom_base odometry at the scan
  MapReport process(const LaserScan& scan, const Pose2& T_odom_base);

  /// The most likely particle.
  [[nodiscard]] std::size_t best() const;
  [[nodiscard]] const PatchMap& bestMap() const;
  /// T_map_base of the most likely particle at the last scan.
  [[nodiscard]] Pose2 pose() const;

  [[nodiscard]] const std::vector<Generation>& generations() const;
  /// Poses of the most likely particle's path, one per generation.
  [[nodiscard]] std::vector<Pose2> bestPath() const;

  /// Bytes of all patches, shared ones once.
  [[nodiscard]] std::size_t patchBytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vestibule::mapping
