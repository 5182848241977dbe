#pragma once

#include <string>

namespace vestibule::sim {

/// What a robot drives on. The factors multiply the robot's own parameters.
struct GroundClass {
  std::string name;
  double icr_scale = 1.0;  ///< distance of the tread ICRs: large where treads slide sideways badly
  double grip_scale = 1.0;
  double slip_scale = 1.0;   ///< of the random part of the grip, bursts included
  double roughness_m = 0.0;  ///< height noise under the wheels, one sigma
};

}  // namespace vestibule::sim
