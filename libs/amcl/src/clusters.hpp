#pragma once

#include <vector>

#include "particle_set.hpp"

namespace vestibule::amcl {

/// Particles that hang together: their bins touch (also diagonally, yaw wraps round).
struct Clusters {
  struct One {
    double weight = 0.0;  ///< share of all
    PoseWithCovariance T_grid_base;
  };
  std::vector<int> label;     ///< per particle, an index into `clusters`
  std::vector<One> clusters;  ///< by falling weight
};

[[nodiscard]] Clusters findClusters(const ParticleSet& particles, double bin_m, double bin_rad);

/// Number of bins in use when n particles are drawn systematically (KLD sampling).
[[nodiscard]] std::size_t occupiedBins(
    const ParticleSet& particles,
    const std::vector<std::uint32_t>& draws,
    double bin_m,
    double bin_rad);

/// Samples for k occupied bins so that the distribution is within epsilon with probability
/// 1 - delta (Fox, IJRR 2003, eq. 13; the quantile is that of the normal distribution).
[[nodiscard]] std::size_t kldSampleSize(std::size_t bins, double epsilon, double delta);

}  // namespace vestibule::amcl
