#include "vestibule/sim/wheels.hpp"

#include <cmath>

#include "vestibule/sim/sensor_rate.hpp"

namespace vestibule::sim {

void describe(ParamIo& io, WheelParams& params) {
  rateField(io, params.rate_hz);
  io.optional("ticks_per_m", params.ticks_per_m, positive());
  io.optionalDegrees("steering_step_deg", params.steering_step_rad, positive());
  io.optional("scale_left", params.scale_left, within(0.5, 2.0));
  io.optional("scale_right", params.scale_right, within(0.5, 2.0));
}

WheelModel::WheelModel(const WheelParams& params, const RobotParams& robot)
    : params_(params),
      drive_(robot.drive),
      nominal_track_m_(robot.nominal_track_m),
      wheelbase_m_(robot.wheelbase_m) {}

WheelOdometry WheelModel::measure(
    Timestamp stamp, double left_travel_m, double right_travel_m, double steering_rad) {
  // The counters round down; the remainder comes with a later message, as with real encoders.
  const auto count = [&](double travel_m) {
    return static_cast<std::int64_t>(std::floor(travel_m * params_.ticks_per_m));
  };
  const std::int64_t left_ticks = count(left_travel_m);
  const std::int64_t right_ticks = count(right_travel_m);
  const double left_m =
      params_.scale_left * static_cast<double>(left_ticks - left_ticks_) / params_.ticks_per_m;
  const double right_m =
      params_.scale_right * static_cast<double>(right_ticks - right_ticks_) / params_.ticks_per_m;
  left_ticks_ = left_ticks;
  right_ticks_ = right_ticks;
  const double forward_m = 0.5 * (left_m + right_m);
  double turn_rad = (right_m - left_m) / nominal_track_m_;
  if (drive_ == DriveType::kAckermann) {
    const double read_rad =
        params_.steering_step_rad * std::round(steering_rad / params_.steering_step_rad);
    turn_rad = forward_m * std::tan(read_rad) / wheelbase_m_;
  }
  return {stamp, 1.0 / params_.rate_hz, expSe2({forward_m, 0.0, turn_rad})};
}

}  // namespace vestibule::sim
