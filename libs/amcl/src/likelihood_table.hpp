#pragma once

#include <vector>

#include "vestibule/amcl/params.hpp"
#include "vestibule/grid/distance_field.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::amcl {

/// End points of the chosen beams in the base frame [m], once per scan.
struct BeamEnds {
  std::vector<float> x;
  std::vector<float> y;
  [[nodiscard]] std::size_t size() const { return x.size(); }
};

/// The beams a scan is weighed by: valid, near enough, spread along the contour, at most max_beams.
[[nodiscard]] BeamEnds chooseBeams(const LaserScan& scan, const LikelihoodField& field);

/// log(z_hit exp(-d^2 / 2 sigma^2) + z_rand / max_range) per cell of the map, d the exact distance
/// to the nearest obstacle. Immutable.
///
/// MRPT's own likelihood field is not used: turning a scan into its points map drops every beam
/// whose neighbour is left out, so a thinned scan keeps almost none, and it evaluates sine, cosine
/// and logarithm per beam.
class LikelihoodTable {
 public:
  LikelihoodTable(
      const grid::OccupancyMap& map,
      const grid::DistanceField& field,
      const LikelihoodField& params);

  /// Sum over the beams. \param T_grid_base pose in the map's grid frame
  [[nodiscard]] double logLikelihood(const Pose2& T_grid_base, const BeamEnds& beams) const;

 private:
  std::vector<float> log_likelihood_;
  float outside_;
  int width_;
  int height_;
  double cells_per_m_;
  Point2 p_grid_corner_;
};

}  // namespace vestibule::amcl
