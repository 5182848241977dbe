#pragma once

#include <cstdint>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::sim {

struct CompassParams {
  bool enabled = false;
  double rate_hz = 10.0;  ///< must divide 200 Hz
  double sigma_rad = degToRad(2.0);
  double deviation_rad = degToRad(2.0);  ///< amplitude of the robot's own iron, one turn per turn
  double soft_iron_rad = 0.0;            ///< amplitude of what the earth magnetises, two per turn
  double indoor_rad =
      degToRad(30.0);            ///< sigma of the disturbance by steel indoors, a function of place
  double indoor_length_m = 3.0;  ///< over which it changes
  double reach_m = 2.0;          ///< e-folding distance of the disturbance outside a building
  double ground_rad = 0.0;       ///< sigma of what lies in the ground anywhere, a function of place
  double ground_length_m = 10.0;  ///< over which it changes
};
void describe(ParamIo& io, CompassParams& params);

/// Magnetic heading that goes wrong near steel and does not know it.
class CompassModel {
 public:
  CompassModel(const CompassParams& params, std::uint64_t seed);
  /// \param distance_to_roof_m  negative under a roof
  [[nodiscard]] Heading measure(
      Timestamp stamp, const Pose2& T_map_base, double distance_to_roof_m);

 private:
  CompassParams params_;
  std::uint64_t seed_;
  std::uint64_t index_ = 0;
  double deviation_phase_rad_;
  double soft_iron_phase_rad_;
};

}  // namespace vestibule::sim
