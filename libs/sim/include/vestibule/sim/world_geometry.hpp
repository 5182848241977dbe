#pragma once

#include <limits>
#include <vector>

#include "vestibule/core/frames.hpp"

namespace vestibule::sim {

struct World;

struct Segment {
  Point2 a;
  Point2 b;
};

/// The outlines of everything solid in a world. Circles become 24-gons around the true circle; an
/// occupancy image becomes its cell edges. Throws InputError when that image cannot be read.
[[nodiscard]] std::vector<Segment> segmentsOf(const World& world);

/// Line segments in a uniform bucket grid: exact ray casts and distances, no rasterisation.
/// Immutable; may be shared between threads.
class WorldGeometry {
 public:
  explicit WorldGeometry(std::vector<Segment> segments);
  explicit WorldGeometry(const World& world);

  [[nodiscard]] const std::vector<Segment>& segments() const { return segments_; }

  /// Distance to the first segment along the ray, or `max_range_m` when none is nearer.
  [[nodiscard]] double castRay(
      const Point2& p_map_origin, double angle_rad, double max_range_m) const;

  /// Distance to the nearest segment [m]; infinite without any.
  [[nodiscard]] double clearance(const Point2& p_map) const;

  /// Distance from a rectangle centred on the pose to the nearest segment [m]; 0 on contact.
  [[nodiscard]] double footprintClearance(
      const Pose2& T_map_base, double half_length_m, double half_width_m) const;
  /// Whether an outline crosses that rectangle.
  [[nodiscard]] bool footprintCollides(
      const Pose2& T_map_base, double half_length_m, double half_width_m) const;

 private:
  struct Line {
    double ax, ay, dx, dy;  // from a, along d to b
  };
  template <class DistanceTo>
  [[nodiscard]] double nearest(const Point2& p, double slack_m, DistanceTo distance_to) const;

  std::vector<Segment> segments_;
  Point2 p_corner_;
  double inverse_cell_ = 1.0;
  double cell_m_ = 1.0;
  int width_ = 0;
  int height_ = 0;
  std::vector<std::size_t> first_;  // cell -> its first entry in lines_; one more than cells
  std::vector<Line> lines_;         // copies, so that a cell's lines lie side by side
};

}  // namespace vestibule::sim
