#pragma once

#include <cstdint>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/sensors/measurements.hpp"
#include "vestibule/sim/robot.hpp"

namespace vestibule::sim {

struct WheelParams {
  double rate_hz = 50.0;                      ///< must divide 200 Hz
  double ticks_per_m = 4000.0;                ///< encoder resolution at the rim
  double steering_step_rad = degToRad(0.05);  ///< resolution of the steering encoder
  double scale_left = 1.0;                    ///< believed / true radius
  double scale_right = 1.0;
};
void describe(ParamIo& io, WheelParams& params);

/// Encoders and the odometry computed from them with the nominal geometry of the robot.
class WheelModel {
 public:
  WheelModel(const WheelParams& params, const RobotParams& robot);
  [[nodiscard]] WheelOdometry measure(
      Timestamp stamp, double left_travel_m, double right_travel_m, double steering_rad = 0.0);

 private:
  WheelParams params_;
  DriveType drive_;
  double nominal_track_m_;
  double wheelbase_m_;
  std::int64_t left_ticks_ = 0;
  std::int64_t right_ticks_ = 0;
};

}  // namespace vestibule::sim
