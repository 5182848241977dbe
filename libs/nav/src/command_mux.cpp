#include "vestibule/nav/command_mux.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace vestibule::nav {
namespace {

constexpr double kYawDeceleration_radps2 = 1.5;
constexpr int kSweepPoses = 12;
/// A point that is already inside the margin must not come nearer; this is rounding.
constexpr double kNearerTolerance_m = 1e-6;

/// Base poses on the way to a standstill, in the present base frame: the command holds for the
/// reaction time, then both velocities fall to zero over the same time.
std::array<Pose2, kSweepPoses> stoppingPath(
    const Command& command, const CollisionStopParams& params) {
  const double brake_s = std::max(
      std::abs(command.v_mps) / params.deceleration_mps2,
      std::abs(command.omega_radps) / kYawDeceleration_radps2);
  // Braking linearly covers half the distance of the same time at full speed.
  const double equivalent_s = params.reaction_s + 0.5 * brake_s;
  std::array<Pose2, kSweepPoses> poses;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double t = equivalent_s * static_cast<double>(i + 1) / kSweepPoses;
    poses[i] = expSe2({command.v_mps * t, 0.0, command.omega_radps * t});
  }
  return poses;
}

}  // namespace

double Footprint::radius() const { return std::hypot(half_length_m, half_width_m); }

double Footprint::signedDistance(const Point2& p_base) const {
  const double dx = std::abs(p_base.x) - half_length_m;
  const double dy = std::abs(p_base.y) - half_width_m;
  if (dx <= 0.0 && dy <= 0.0) return std::max(dx, dy);
  return std::hypot(std::max(dx, 0.0), std::max(dy, 0.0));
}

void describe(ParamIo& io, Footprint& footprint) {
  io.optional("half_length_m", footprint.half_length_m, positive());
  io.optional("half_width_m", footprint.half_width_m, positive());
}

void describe(ParamIo& io, CollisionStopParams& params) {
  io.optional("margin_m", params.margin_m, nonNegative());
  io.optional("deceleration_mps2", params.deceleration_mps2, positive());
  io.optional("reaction_s", params.reaction_s, nonNegative());
}

void describe(ParamIo& io, CommandMuxParams& params) {
  io.optional("max_pose_age_s", params.max_pose_age_s, positive());
  io.optional("max_scan_age_s", params.max_scan_age_s, positive());
  io.section("collision_stop", params.collision_stop);
}

CollisionStop::CollisionStop(const CollisionStopParams& params, const Footprint& footprint)
    : params_(params), footprint_(footprint) {}

CollisionStop::Result CollisionStop::limit(
    const Command& wanted, const std::vector<Point2>& obstacles_base) const {
  Result result;
  result.clearance_m = std::numeric_limits<double>::infinity();
  for (const Point2& p : obstacles_base) {
    result.clearance_m = std::min(result.clearance_m, footprint_.signedDistance(p));
  }

  const auto isFree = [&](const Command& command) {
    if (command.v_mps == 0.0 && command.omega_radps == 0.0) return true;
    const auto poses = stoppingPath(command, params_);
    const double reach_m =
        footprint_.radius() + params_.margin_m + translationNorm(poses.back()) + 0.1;
    for (const Point2& p : obstacles_base) {
      if (std::abs(p.x) > reach_m || std::abs(p.y) > reach_m) continue;
      const double allowed_m =
          std::min(params_.margin_m, footprint_.signedDistance(p) - kNearerTolerance_m);
      for (const Pose2& T_base_later : poses) {
        const Point2 p_later = transform(inverse(T_base_later), p);
        if (footprint_.signedDistance(p_later) < allowed_m) return false;
      }
    }
    return true;
  };

  for (const double scale : {1.0, 0.75, 0.5, 0.25, 0.1}) {
    const Command scaled{wanted.v_mps * scale, wanted.omega_radps * scale};
    if (!isFree(scaled)) continue;
    result.command = scaled;
    result.scale = scale;
    return result;
  }
  result.scale = 0.0;
  // The way is shut, but the turn alone may be possible.
  const Command turn{0.0, 0.5 * wanted.omega_radps};
  if (isFree(turn)) result.command = turn;
  return result;
}

std::string_view toString(CommandSource source) {
  switch (source) {
    case CommandSource::kMission:
      return "mission";
    case CommandSource::kRecovery:
      return "recovery";
    case CommandSource::kEmergencyStop:
      return "emergency stop";
    case CommandSource::kNone:
      break;
  }
  return "none";
}

CommandMux::CommandMux(const CommandMuxParams& params, const Footprint& footprint)
    : params_(params), collision_stop_(params.collision_stop, footprint) {}

CommandMux::Result CommandMux::select(
    const CommandInputs& inputs,
    const std::optional<Command>& mission,
    const std::optional<Command>& recovery,
    const std::vector<Point2>& obstacles_base) const {
  Result result;
  if (emergency_stop_) {
    result.source = CommandSource::kEmergencyStop;
    result.limit = "emergency stop";
  } else if (recovery) {
    result.source = CommandSource::kRecovery;
  } else if (mission) {
    result.source = CommandSource::kMission;
  }
  const Command wanted =
      emergency_stop_ ? Command{} : recovery.value_or(mission.value_or(Command{}));
  const CollisionStop::Result checked = collision_stop_.limit(wanted, obstacles_base);
  result.clearance_m = checked.clearance_m;
  if (emergency_stop_ || result.source == CommandSource::kNone) return result;

  if (!inputs.pose_stamp) {
    result.limit = "no pose";
  } else if (toSeconds(inputs.stamp - *inputs.pose_stamp) > params_.max_pose_age_s) {
    result.limit = "stale pose";
  } else if (!inputs.scan_stamp) {
    result.limit = "no scan";
  } else if (toSeconds(inputs.stamp - *inputs.scan_stamp) > params_.max_scan_age_s) {
    result.limit = "stale scan";
  } else if (!std::isfinite(wanted.v_mps) || !std::isfinite(wanted.omega_radps)) {
    result.limit = "not a number";
  } else {
    if (checked.scale < 1.0) result.limit = "obstacle";
    result.command = checked.command;
  }
  return result;
}

}  // namespace vestibule::nav
