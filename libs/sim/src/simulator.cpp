#include "vestibule/sim/simulator.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "rotation.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/sim/place_noise.hpp"

namespace vestibule::sim {
namespace {

constexpr double kGravity_mps2 = 9.80665;
constexpr double kRoughnessLength_m = 0.3;
constexpr Duration kMomentPeriod = std::chrono::milliseconds(20);

bool isLevel(const World& world) {
  const bool rough_area =
      std::any_of(world.ground_areas.begin(), world.ground_areas.end(), [](const GroundArea& area) {
        return area.ground.roughness_m > 0.0;
      });
  return world.terrain.flat() && world.ground.roughness_m == 0.0 && !rough_area;
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
  io.section("ring_lidar", params.ring_lidar);
  io.section("gnss", params.gnss);
  io.section("compass", params.compass);
  io.section("transport", params.transport);
  io.optional("suspension_hz", params.suspension_hz, within(0.5, 20.0));
}

Simulator::Simulator(
    const World& world, const SimParams& params, const Pose2& T_map_base, std::uint64_t seed)
    : params_(params),
      geometry_(std::make_unique<const WorldGeometry>(world)),
      seed_(seed),
      robot_(params.robot, T_map_base, seed),
      wheels_(params.wheels, params.robot),
      imu_(params.imu, seed),
      gnss_(*geometry_, world.datum, params.gnss, seed),
      compass_(params.compass, seed),
      transport_(params.transport, kStartOfTime, seed),
      level_(isLevel(world)),
      moment_(geometry_->momentAt(0.0)),
      min_clearance_m_(geometry_->footprintClearance(
          T_map_base, params.footprint.half_length_m, params.footprint.half_width_m, moment_)),
      collided_(min_clearance_m_ <= 0.0) {
  history_.push_back(onTheGround(T_map_base));
  imu_R_map_base_ = rotationOf(history_.back());
}

Pose3 Simulator::onTheGround(const Pose2& T_map_base) const {
  Pose3 T = toPose3(T_map_base);
  if (level_) return T;
  // The plane through the four wheel contacts, in the least-squares sense.
  const double hx = 0.5 * params_.robot.wheelbase_m;
  const double hy = 0.5 * params_.robot.nominal_track_m;
  const std::uint64_t rough_seed = derivedSeed(1, "roughness");  // the ground is the same for all
  const auto height = [&](double x, double y) {
    const Point2 p = transform(T_map_base, {x, y});
    double z = geometry_->groundHeight(p);
    const double roughness_m = geometry_->groundAt(p).roughness_m;
    if (roughness_m > 0.0) z += roughness_m * placeNoise(rough_seed, 0, p, kRoughnessLength_m);
    return z;
  };
  const double front_left = height(hx, hy);
  const double front_right = height(hx, -hy);
  const double rear_left = height(-hx, hy);
  const double rear_right = height(-hx, -hy);
  T.z = 0.25 * (front_left + front_right + rear_left + rear_right);
  const double along = (front_left + front_right - rear_left - rear_right) / (4.0 * hx);
  const double across = (front_left + rear_left - front_right - rear_right) / (4.0 * hy);
  T.pitch = -std::atan(along);
  T.roll = std::atan(across);
  return T;
}

void Simulator::settle(double dt_s) {
  const Pose3 wanted = onTheGround(robot_.pose());
  Pose3 next = history_.back();
  next.x = wanted.x;
  next.y = wanted.y;
  next.yaw = wanted.yaw;
  if (level_) {
    next = wanted;
  } else {
    // Critically damped second order for height, roll and pitch.
    const double rate = 2.0 * kPi * params_.suspension_hz;
    const Eigen::Vector3d error(
        wanted.z - next.z, wanted.roll - next.roll, wanted.pitch - next.pitch);
    attitude_speed_ += dt_s * (rate * rate * error - 2.0 * rate * attitude_speed_);
    next.z += dt_s * attitude_speed_.x();
    next.roll += dt_s * attitude_speed_.y();
    next.pitch += dt_s * attitude_speed_.z();
  }
  history_.push_back(next);
  const double longest_s = std::max(
      {params_.lidar.sweep_s,
       params_.ring_lidar.enabled ? 1.0 / params_.ring_lidar.rate_hz : 0.0,
       1.0 / params_.imu.rate_hz});
  const auto keep = static_cast<std::size_t>(longest_s / toSeconds(kTruthStep)) + 3;
  while (history_.size() > keep) history_.pop_front();
}

Pose3 Simulator::during(double span_s, double share) const {
  const double steps_back = (1.0 - share) * span_s / toSeconds(kTruthStep);
  const double place = std::max(static_cast<double>(history_.size() - 1) - steps_back, 0.0);
  const auto before = static_cast<std::size_t>(place);
  if (before + 1 >= history_.size()) return history_.back();
  const double s = place - static_cast<double>(before);
  const Pose3& a = history_[before];
  const Pose3& b = history_[before + 1];
  const auto mix = [s](double from, double to) { return from + s * (to - from); };
  return {
      mix(a.x, b.x),
      mix(a.y, b.y),
      mix(a.z, b.z),
      a.yaw + s * angleDiff(b.yaw, a.yaw),
      mix(a.pitch, b.pitch),
      mix(a.roll, b.roll)};
}

void Simulator::carryTo(const Pose2& T_map_base) {
  robot_.setPose(T_map_base);
  const Pose3 T = onTheGround(T_map_base);
  for (Pose3& past : history_) past = T;
  imu_R_map_base_ = rotationOf(T);
  imu_velocity_map_.setZero();
}

void Simulator::advanceTruth() {
  const Pose2& here = robot_.pose();
  const Pose3& attitude = history_.back();
  if (steps_ % static_cast<std::uint64_t>(kMomentPeriod / kTruthStep) == 0) {
    moment_ = geometry_->momentAt(toSeconds(time_ - kStartOfTime));
  }
  Pose2 T_before_now = robot_.advance(
      kTruthStep, geometry_->groundAt({here.x, here.y}), attitude.roll, attitude.pitch);
  // Seen from above a step along a slope is shorter.
  T_before_now.x *= std::cos(attitude.pitch);
  T_before_now.y *= std::cos(attitude.roll);
  const Pose2 T_map_next = compose(here, T_before_now);
  if (T_before_now.x != 0.0 || T_before_now.y != 0.0 || T_before_now.phi != 0.0) {
    const double clearance_m = geometry_->footprintClearance(
        T_map_next, params_.footprint.half_length_m, params_.footprint.half_width_m, moment_);
    min_clearance_m_ = std::min(min_clearance_m_, clearance_m);
    if (clearance_m <= 0.0) {
      collided_ = true;
      T_before_now = Pose2{};
    } else {
      robot_.setPose(T_map_next);
    }
  }
  settle(toSeconds(kTruthStep));
  distance_m_ += translationNorm(T_before_now);
  twist_base_ = logSe2(T_before_now) / toSeconds(kTruthStep);
  time_ = time_ + kTruthStep;
  ++steps_;
}

void Simulator::measureImu() {
  const double interval_s = 1.0 / params_.imu.rate_hz;
  const Pose3& now = history_.back();
  const Eigen::Matrix3d R = rotationOf(now);
  // Rate: the rotation since the last message; force: the change of the velocity of the IMU's own
  // place, seen in the axes half way.
  const Eigen::AngleAxisd turn(imu_R_map_base_.transpose() * R);
  const Eigen::Vector3d omega = turn.angle() * turn.axis() / interval_s;
  const Eigen::Matrix3d R_middle =
      imu_R_map_base_ * Eigen::AngleAxisd(0.5 * turn.angle(), turn.axis()).toRotationMatrix();
  const auto place = [&](const Pose3& T) -> Eigen::Vector3d {
    return positionOf(T) + rotationOf(T) * params_.imu.p_base_imu;
  };
  const Eigen::Vector3d velocity =
      (place(now) - place(history_[history_.size() - 2])) / toSeconds(kTruthStep);
  const Eigen::Vector3d acceleration = (velocity - imu_velocity_map_) / interval_s;
  const Eigen::Vector3d force =
      R_middle.transpose() * (acceleration + kGravity_mps2 * Eigen::Vector3d::UnitZ());
  transport_.send(imu_.measure(time_, omega, force, twist_base_.head<2>().norm()));
  imu_R_map_base_ = R;
  imu_velocity_map_ = velocity;
}

std::vector<Delivered> Simulator::step(Duration dt) {
  assert(dt.count() > 0 && dt.count() % kTruthStep.count() == 0);
  std::vector<Delivered> all;
  const auto count = dt.count() / kTruthStep.count();
  for (Duration::rep i = 0; i < count; ++i) {
    advanceTruth();
    const Pose2& truth = robot_.pose();
    const Point2 here{truth.x, truth.y};
    if (due(steps_, params_.wheels.rate_hz)) {
      transport_.send(
          wheels_.measure(time_, robot_.leftTravel(), robot_.rightTravel(), robot_.steering()));
    }
    if (due(steps_, params_.imu.rate_hz)) measureImu();
    if (params_.compass.enabled && due(steps_, params_.compass.rate_hz)) {
      transport_.send(compass_.measure(time_, truth, geometry_->distanceToRoofs(here)));
    }
    if (due(steps_, params_.gnss.rate_hz)) {
      const Point2& arm = params_.rig.p_base_antenna;
      const Eigen::Vector3d p_base_antenna(arm.x, arm.y, params_.gnss.antenna_height_m);
      const auto place = [&p_base_antenna](const Pose3& T) -> Eigen::Vector3d {
        return positionOf(T) + rotationOf(T) * p_base_antenna;
      };
      const Eigen::Vector3d p_map_antenna = place(history_.back());
      const Eigen::Vector3d v_map_antenna =
          (p_map_antenna - place(history_[history_.size() - 2])) / toSeconds(kTruthStep);
      transport_.send(gnss_.measure(time_, moment_, p_map_antenna, v_map_antenna));
    }
    if (due(steps_, params_.lidar.rate_hz)) {
      const double sweep_s = params_.lidar.sweep_s;
      transport_.send(simulateScan(
          *geometry_,
          moment_,
          params_.lidar,
          [&](double share) { return during(sweep_s, share); },
          params_.rig.T_base_laser,
          time_ - durationFromSeconds(sweep_s),
          seed_,
          scans_++));
    }
    if (params_.ring_lidar.enabled && due(steps_, params_.ring_lidar.rate_hz)) {
      const double turn_s = 1.0 / params_.ring_lidar.rate_hz;
      sweeps_.push_back(simulateSweep(
          *geometry_,
          moment_,
          params_.ring_lidar,
          [&](double share) { return during(turn_s, share); },
          time_ - durationFromSeconds(turn_s),
          seed_,
          sweeps_made_++));
    }
    for (Delivered& delivered : transport_.receive(time_)) all.push_back(std::move(delivered));
  }
  return all;
}

std::vector<LidarSweep> Simulator::takeSweeps() { return std::exchange(sweeps_, {}); }

}  // namespace vestibule::sim
