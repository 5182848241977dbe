#include "vestibule/sim/imu.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/sim/sensor_rate.hpp"

namespace vestibule::sim {
namespace {

Eigen::Vector3d normal3(RandomStream& random) {
  const double x = random.normal();
  const double y = random.normal();
  const double z = random.normal();
  return {x, y, z};
}

}  // namespace

void describe(ParamIo& io, InertialNoise& noise) {
  io.optional("noise", noise.noise, nonNegative());
  io.optional("bias_sigma", noise.bias_sigma, nonNegative());
  io.optional("instability", noise.instability, nonNegative());
  io.optional("instability_s", noise.instability_s, positive());
  io.optional("walk", noise.walk, nonNegative());
  io.optional("scale_sigma", noise.scale_sigma, within(0.0, 0.5));
  io.optional("limit", noise.limit, positive());
  io.optional("vibration", noise.vibration, nonNegative());
  io.optional("drift", noise.drift);
}

void describe(ParamIo& io, ImuParams& params) {
  rateField(io, params.rate_hz);
  std::vector<double> position{params.p_base_imu.x(), params.p_base_imu.y(), params.p_base_imu.z()};
  io.optional("position_m", position, 3, 3);
  params.p_base_imu = {position[0], position[1], position[2]};
  io.optional("vibration_hz", params.vibration_hz, positive());
  io.section("gyro", params.gyro);
  io.section("accel", params.accel);
}

ImuModel::ImuModel(const ImuParams& params, std::uint64_t seed) : params_(params), seed_(seed) {
  const auto start = [&](Triad& triad, const InertialNoise& noise, const char* stream) {
    RandomStream random(seed_, stream);
    triad.constant = noise.bias_sigma * normal3(random);
    triad.markov = noise.instability * normal3(random);
    triad.scale = noise.scale_sigma * normal3(random);
    triad.bias = triad.constant + triad.markov;
  };
  start(gyro_, params_.gyro, "gyro start");
  start(accel_, params_.accel, "accel start");
}

Eigen::Vector3d ImuModel::corrupt(
    Triad& triad,
    const InertialNoise& noise,
    const Eigen::Vector3d& truth,
    double speed_mps,
    const char* stream) {
  RandomStream random(seed_, stream, index_);
  const double dt_s = 1.0 / params_.rate_hz;
  const double keep = std::exp(-dt_s / noise.instability_s);
  triad.markov =
      keep * triad.markov + noise.instability * std::sqrt(1.0 - keep * keep) * normal3(random);
  triad.walk += noise.walk * std::sqrt(dt_s) * normal3(random);
  const double time_s = static_cast<double>(index_) * dt_s;
  triad.bias =
      triad.constant + triad.markov + triad.walk + Eigen::Vector3d::Constant(noise.drift * time_s);
  Eigen::Vector3d value = truth + triad.scale.cwiseProduct(truth) + triad.bias +
                          noise.noise * std::sqrt(params_.rate_hz) * normal3(random);
  if (noise.vibration > 0.0) {
    const double phase = 2.0 * kPi * params_.vibration_hz * time_s;
    const double amplitude = noise.vibration * std::abs(speed_mps);
    value +=
        amplitude * Eigen::Vector3d(std::sin(phase), std::sin(1.3 * phase), std::sin(0.8 * phase));
  }
  return value.cwiseMax(-noise.limit).cwiseMin(noise.limit);
}

Imu ImuModel::measure(
    Timestamp stamp,
    const Eigen::Vector3d& omega_radps,
    const Eigen::Vector3d& force_mps2,
    double speed_mps) {
  Imu imu;
  imu.stamp = stamp;
  imu.omega_radps = corrupt(gyro_, params_.gyro, omega_radps, speed_mps, "gyro");
  imu.accel_mps2 = corrupt(accel_, params_.accel, force_mps2, speed_mps, "accel");
  ++index_;
  return imu;
}

}  // namespace vestibule::sim
