#pragma once

#include <Eigen/Core>
#include <vector>

#include "vestibule/sim/terrain.hpp"

namespace vestibule::sim {

/// Where rays meet a terrain. A pyramid over its extent knows the lowest and the highest ground of
/// every cell, so that a ray passes the air above in a few steps (maximum mipmaps: Tevs, Ihrke and
/// Seidel, I3D 2008). Beyond the extent the ground is at 0. Immutable; may be shared by threads.
class GroundRays {
 public:
  /// \param terrain must outlive this
  explicit GroundRays(const Terrain& terrain);

  /// Distance along the ray to the ground, or `max_range_m`; 0 from below the ground. Ridges that
  /// are narrower than 0.1 m along the ray may be missed. \pre direction has unit length
  [[nodiscard]] double range(
      const Eigen::Vector3d& p_map_origin,
      const Eigen::Vector3d& direction_map,
      double max_range_m) const;

 private:
  struct Span {
    float low_m = 0.0F;
    float high_m = 0.0F;
  };
  struct Level {
    int columns = 0;
    int rows = 0;
    std::vector<Span> spans;
  };
  struct Ray;
  [[nodiscard]] Span leafSpan(int column, int row) const;
  [[nodiscard]] double withinExtent(const Ray& ray, double from_m, double to_m) const;
  [[nodiscard]] double withinLeaf(
      const Ray& ray, const Span& span, double from_m, double to_m) const;

  const Terrain& terrain_;
  Point2 p_corner_;
  double leaf_m_ = 1.0;
  std::vector<Level> levels_;  // from the leaves to one cell; empty on flat ground
};

}  // namespace vestibule::sim
