#include "vestibule/sensors/compass.hpp"

#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule {

double CompassDeviation::at(double reading_bearing_rad) const {
  const std::vector<double>& k = coefficients_deg;
  const double a = reading_bearing_rad;
  return degToRad(
      k[0] + k[1] * std::sin(a) + k[2] * std::cos(a) + k[3] * std::sin(2.0 * a) +
      k[4] * std::cos(2.0 * a));
}

Heading CompassDeviation::corrected(Heading heading) const {
  if (!known()) return heading;
  // Bearing and yaw run against each other, and one turns into the other by the same equation.
  heading.yaw_rad = wrapToPi(heading.yaw_rad + at(yawFromBearing(heading.yaw_rad)));
  heading.offset_sigma_rad = sigma_rad;
  return heading;
}

void describe(ParamIo& io, CompassDeviation& deviation) {
  io.optional("deviation_deg", deviation.coefficients_deg, 0, 5);
  if (!io.writing() && deviation.known() && deviation.coefficients_deg.size() != 5) {
    io.problem("deviation_deg", "needs the five coefficients A, B, C, D, E, or none");
  }
  io.optionalDegrees("sigma_deg", deviation.sigma_rad, positive());
}

}  // namespace vestibule
