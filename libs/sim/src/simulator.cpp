#include "vestibule/sim/simulator.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace vestibule::sim {
namespace {

/// Whether a sensor of this rate measures at the given truth step (counted from 1).
bool due(std::uint64_t step, double rate_hz) {
  const double steps = 1.0 / (rate_hz * toSeconds(kTruthStep));
  return step % static_cast<std::uint64_t>(std::llround(steps)) == 0;
}

Point2 antennaOf(const Pose2& T_map_base, const SensorRig& rig) {
  return transform(T_map_base, rig.p_base_antenna);
}

}  // namespace

void describe(ParamIo& io, Footprint& footprint) {
  io.optional("half_length_m", footprint.half_length_m, positive());
  io.optional("half_width_m", footprint.half_width_m, positive());
}

void describe(ParamIo& io, SimParams& params) {
  io.section("robot", params.robot);
  io.section("footprint", params.footprint);
  io.section("rig", params.rig);
  io.section("wheels", params.wheels);
  io.section("imu", params.imu);
  io.section("lidar", params.lidar);
  io.section("gnss", params.gnss);
}

Simulator::Simulator(
    const World& world, const SimParams& params, const Pose2& T_map_base, std::uint64_t seed)
    : params_(params),
      geometry_(world),
      seed_(seed),
      robot_(params.robot, T_map_base, seed),
      wheels_(params.wheels, params.robot.nominal_track_m),
      imu_(params.imu, seed),
      gnss_(world, params.gnss, seed),
      min_clearance_m_(geometry_.footprintClearance(
          T_map_base, params.footprint.half_length_m, params.footprint.half_width_m)),
      collided_(min_clearance_m_ <= 0.0) {}

void Simulator::advanceTruth() {
  Pose2 T_before_now = robot_.advance(kTruthStep);
  const Pose2 T_map_next = compose(robot_.pose(), T_before_now);
  if (T_before_now.x != 0.0 || T_before_now.y != 0.0 || T_before_now.phi != 0.0) {
    const double clearance_m = geometry_.footprintClearance(
        T_map_next, params_.footprint.half_length_m, params_.footprint.half_width_m);
    min_clearance_m_ = std::min(min_clearance_m_, clearance_m);
    if (clearance_m <= 0.0) {
      collided_ = true;
      T_before_now = Pose2{};
    } else {
      robot_.setPose(T_map_next);
    }
  }
  distance_m_ += translationNorm(T_before_now);
  twist_base_ = logSe2(T_before_now) / toSeconds(kTruthStep);
  imu_turn_rad_ += T_before_now.phi;
  time_ = time_ + kTruthStep;
  ++steps_;
}

std::vector<Measurement> Simulator::step(Duration dt) {
  assert(dt.count() > 0 && dt.count() % kTruthStep.count() == 0);
  std::vector<Measurement> measurements;
  const auto count = dt.count() / kTruthStep.count();
  for (Duration::rep i = 0; i < count; ++i) {
    advanceTruth();
    if (due(steps_, params_.wheels.rate_hz)) {
      measurements.emplace_back(wheels_.measure(time_, robot_.leftTravel(), robot_.rightTravel()));
    }
    if (due(steps_, params_.imu.rate_hz)) {
      const double interval_s = 1.0 / params_.imu.rate_hz;
      const double omega_radps = imu_turn_rad_ / interval_s;
      const Eigen::Vector2d velocity = twist_base_.head<2>();
      // Acceleration of the base seen in axes that turn with it: dv/dt + omega x v.
      const Eigen::Vector2d accel = (velocity - imu_velocity_base_) / interval_s +
                                    omega_radps * Eigen::Vector2d(-velocity.y(), velocity.x());
      measurements.emplace_back(imu_.measure(time_, omega_radps, accel));
      imu_turn_rad_ = 0.0;
      imu_velocity_base_ = velocity;
    }
    if (due(steps_, params_.gnss.rate_hz)) {
      measurements.emplace_back(gnss_.measure(time_, antennaOf(robot_.pose(), params_.rig)));
    }
    if (due(steps_, params_.lidar.rate_hz)) {
      measurements.emplace_back(simulateScan(
          geometry_,
          params_.lidar,
          robot_.pose(),
          params_.rig.T_base_laser,
          time_,
          seed_,
          scans_++));
    }
  }
  return measurements;
}

}  // namespace vestibule::sim
