#include "vestibule/sim/sensor_models.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::sim {
namespace {

constexpr double kTruthRate_hz = 200.0;
constexpr double kGravity_mps2 = 9.80665;

void rateField(ParamIo& io, double& rate_hz) {
  io.optional("rate_hz", rate_hz, within(0.1, kTruthRate_hz));
  const double steps = kTruthRate_hz / rate_hz;
  if (std::abs(steps - std::round(steps)) > 1e-9) {
    io.problem("rate_hz", "must divide 200 Hz, e.g. 5, 10, 20, 50, 100");
  }
}

Eigen::Vector3d normal3(RandomStream& random) {
  const double x = random.normal();
  const double y = random.normal();
  const double z = random.normal();
  return {x, y, z};
}

}  // namespace

void describe(ParamIo& io, LidarParams& params) {
  rateField(io, params.rate_hz);
  io.optional("beams", params.beams, within(2, 20000));
  io.optionalDegrees(
      "field_of_view_deg", params.field_of_view_rad, Bounds{0.0, 360.0, true, false});
  io.optional("range_min_m", params.range_min_m, nonNegative());
  io.optional("range_max_m", params.range_max_m, positive());
  io.optional("sigma_m", params.sigma_m, nonNegative());
  io.optional("drop_out", params.drop_out, within(0.0, 1.0));
  io.optional("outliers", params.outliers, within(0.0, 1.0));
}

void describe(ParamIo& io, ImuParams& params) {
  rateField(io, params.rate_hz);
  io.optional("gyro_noise", params.gyro_noise, nonNegative());
  io.optional("gyro_bias_sigma", params.gyro_bias_sigma, nonNegative());
  io.optional("gyro_bias_walk", params.gyro_bias_walk, nonNegative());
  io.optional("accel_noise", params.accel_noise, nonNegative());
  io.optional("accel_bias_sigma", params.accel_bias_sigma, nonNegative());
  io.optional("accel_bias_walk", params.accel_bias_walk, nonNegative());
}

void describe(ParamIo& io, WheelParams& params) {
  rateField(io, params.rate_hz);
  io.optional("ticks_per_m", params.ticks_per_m, positive());
}

LaserScan simulateScan(
    const WorldGeometry& geometry,
    const LidarParams& params,
    const Pose2& T_map_base,
    const Pose2& T_base_laser,
    Timestamp stamp,
    std::uint64_t seed,
    std::uint64_t index) {
  RandomStream random(seed, "lidar", index);
  LaserScan scan;
  scan.stamp = stamp;
  scan.angle_min_rad = -0.5 * params.field_of_view_rad;
  scan.angle_step_rad = params.field_of_view_rad / (params.beams - 1);
  scan.range_min_m = params.range_min_m;
  scan.range_max_m = params.range_max_m;
  scan.T_base_laser = T_base_laser;
  scan.ranges_m.reserve(static_cast<std::size_t>(params.beams));
  const Pose2 T_map_laser = compose(T_map_base, T_base_laser);
  const Point2 p_map_laser{T_map_laser.x, T_map_laser.y};
  for (int i = 0; i < params.beams; ++i) {
    const double angle_rad = T_map_laser.phi + scan.angle(static_cast<std::size_t>(i));
    double range_m = geometry.castRay(p_map_laser, angle_rad, params.range_max_m);
    const double fate = random.uniform();
    if (fate < params.drop_out) {
      range_m = params.range_max_m;
    } else if (fate < params.drop_out + params.outliers) {
      range_m = random.uniform(params.range_min_m, range_m);
    } else if (range_m < params.range_max_m) {
      range_m = std::max(range_m + random.normal(0.0, params.sigma_m), 0.0);
    }
    scan.ranges_m.push_back(
        range_m < params.range_max_m ? static_cast<float>(range_m)
                                     : std::numeric_limits<float>::infinity());
  }
  return scan;
}

ImuModel::ImuModel(const ImuParams& params, std::uint64_t seed) : params_(params), seed_(seed) {
  RandomStream random(seed_, "imu start");
  gyro_bias_ = params_.gyro_bias_sigma * normal3(random);
  accel_bias_ = params_.accel_bias_sigma * normal3(random);
}

Imu ImuModel::measure(Timestamp stamp, double omega_radps, const Eigen::Vector2d& accel_mps2) {
  RandomStream random(seed_, "imu", index_++);
  const double root_rate = std::sqrt(params_.rate_hz);
  gyro_bias_ += params_.gyro_bias_walk / root_rate * normal3(random);
  accel_bias_ += params_.accel_bias_walk / root_rate * normal3(random);
  Imu imu;
  imu.stamp = stamp;
  imu.omega_radps = Eigen::Vector3d(0.0, 0.0, omega_radps) + gyro_bias_ +
                    params_.gyro_noise * root_rate * normal3(random);
  imu.accel_mps2 = Eigen::Vector3d(accel_mps2.x(), accel_mps2.y(), kGravity_mps2) + accel_bias_ +
                   params_.accel_noise * root_rate * normal3(random);
  return imu;
}

WheelModel::WheelModel(const WheelParams& params, double nominal_track_m)
    : params_(params), nominal_track_m_(nominal_track_m) {}

WheelOdometry WheelModel::measure(Timestamp stamp, double left_travel_m, double right_travel_m) {
  // The counters round down; the remainder comes with a later message, as with real encoders.
  const auto count = [&](double travel_m) {
    return static_cast<std::int64_t>(std::floor(travel_m * params_.ticks_per_m));
  };
  const std::int64_t left_ticks = count(left_travel_m);
  const std::int64_t right_ticks = count(right_travel_m);
  const double left_m = static_cast<double>(left_ticks - left_ticks_) / params_.ticks_per_m;
  const double right_m = static_cast<double>(right_ticks - right_ticks_) / params_.ticks_per_m;
  left_ticks_ = left_ticks;
  right_ticks_ = right_ticks;
  const double forward_m = 0.5 * (left_m + right_m);
  const double turn_rad = (right_m - left_m) / nominal_track_m_;
  return {stamp, 1.0 / params_.rate_hz, expSe2({forward_m, 0.0, turn_rad})};
}

}  // namespace vestibule::sim
