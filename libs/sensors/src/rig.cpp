#include "vestibule/sensors/rig.hpp"

#include "vestibule/core/angles.hpp"

namespace vestibule {

void describe(ParamIo& io, SensorRig& rig) {
  io.optional("laser", rig.T_base_laser);
  std::vector<double> antenna{rig.p_base_antenna.x, rig.p_base_antenna.y};
  io.optional("antenna", antenna, 2, 2);
  rig.p_base_antenna = {antenna[0], antenna[1]};

  io.optionalDegrees("imu_yaw_deg", rig.imu_yaw_rad, within(-180.0, 180.0));
  bool upside_down = rig.imu_sign_z < 0.0;
  io.optional("imu_upside_down", upside_down);
  rig.imu_sign_z = upside_down ? -1.0 : 1.0;
  io.section("compass", rig.compass);
}

}  // namespace vestibule
