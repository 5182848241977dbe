#include "vestibule/sensors/rig.hpp"

#include "vestibule/core/angles.hpp"

namespace vestibule {

void describe(ParamIo& io, SensorRig& rig) {
  std::vector<double> laser{rig.T_base_laser.x, rig.T_base_laser.y, radToDeg(rig.T_base_laser.phi)};
  io.optional("laser", laser, 3, 3);
  rig.T_base_laser = {laser[0], laser[1], wrapToPi(degToRad(laser[2]))};

  std::vector<double> antenna{rig.p_base_antenna.x, rig.p_base_antenna.y};
  io.optional("antenna", antenna, 2, 2);
  rig.p_base_antenna = {antenna[0], antenna[1]};

  io.optionalDegrees("imu_yaw_deg", rig.imu_yaw_rad, within(-180.0, 180.0));
  bool upside_down = rig.imu_sign_z < 0.0;
  io.optional("imu_upside_down", upside_down);
  rig.imu_sign_z = upside_down ? -1.0 : 1.0;
}

}  // namespace vestibule
