#pragma once

#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/geo/site.hpp"

namespace vestibule::sim {

/// Heights on a regular grid, row 0 at the bottom; 0 outside.
struct HeightField {
  std::string image;  ///< PNG with 8 or 16 bits, float TIFF or ESRI ASCII grid (.asc)
  double resolution_m = 0.5;
  Pose2 T_map_image;    ///< lower left corner
  double low_m = 0.0;   ///< height of a black pixel; PNG only
  double high_m = 1.0;  ///< height of a white pixel
  int columns = 0;
  int rows = 0;
  std::vector<float> heights_m;
  SourceRef source;  ///< in the world file
};

/// A straight slope; `from` and `to` are the middles of its lower and upper edge.
struct Ramp {
  Point2 from;
  Point2 to;
  double width_m = 1.0;
  double start_m = 0.0;  ///< height at `from`
  double rise_m = 0.0;   ///< from there to `to`; negative leads down
};

/// A level area.
struct Plate {
  geo::Polygon outline;
  double height_m = 0.0;
};

/// Height of the ground: the field, covered by plates and then ramps, later ones on top.
struct Terrain {
  std::vector<HeightField> fields;  ///< at most one
  std::vector<Plate> plates;
  std::vector<Ramp> ramps;

  [[nodiscard]] bool flat() const { return fields.empty() && plates.empty() && ramps.empty(); }
  [[nodiscard]] double height(const Point2& p_map) const;
};
/// Reads the heights of `field.image`; all of them are finite. Throws InputError.
void loadHeights(HeightField& field);

}  // namespace vestibule::sim
