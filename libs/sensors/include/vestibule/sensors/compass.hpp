#pragma once

#include <vector>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule {

/// Deviation of a compass on its robot: what its reading exceeds the true bearing by, both
/// clockwise from north. Iron that turns with the robot bends it with the heading (A. Smith's
/// formula, 1851; US National Geospatial-Intelligence Agency, Handbook of Magnetic Compass
/// Adjustment, 2004, ch. 2):
///
///   reading - true = A + B sin(reading) + C cos(reading) + D sin(2 reading) + E cos(2 reading)
///
/// A also holds mounting and declination.
struct CompassDeviation {
  std::vector<double> coefficients_deg;  ///< A, B, C, D, E; empty = not known
  double sigma_rad = degToRad(3.0);      ///< one sigma of the constant error that it leaves

  [[nodiscard]] bool known() const { return !coefficients_deg.empty(); }
  /// [rad] at a reading, given and returned clockwise. Precondition: known().
  [[nodiscard]] double at(double reading_bearing_rad) const;
  /// The heading without its deviation, and marked as calibrated; as it is where nothing is known.
  [[nodiscard]] Heading corrected(Heading heading) const;
};

/// Keys: deviation_deg: [A, B, C, D, E], sigma_deg.
void describe(ParamIo& io, CompassDeviation& deviation);

}  // namespace vestibule
