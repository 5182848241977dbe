#pragma once

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/sensors/compass.hpp"

namespace vestibule {

/// Where the sensors sit on the robot. All in the base frame, metres and radians.
struct SensorRig {
  Pose2 T_base_laser;             ///< used where a recording does not carry the laser's pose itself
  Point2 p_base_antenna;          ///< lever arm of the GNSS antenna
  double imu_yaw_rad = 0.0;       ///< yaw of the IMU's x axis from the robot's
  double imu_sign_z = 1.0;        ///< -1 for an IMU mounted upside down
  CompassDeviation compass = {};  ///< of the headings, where it is known
};

/// Keys: laser: [x_m, y_m, yaw_deg], antenna: [x_m, y_m], imu_yaw_deg, imu_upside_down,
/// compass.
void describe(ParamIo& io, SensorRig& rig);

}  // namespace vestibule
