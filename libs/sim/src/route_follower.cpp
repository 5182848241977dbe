#include "vestibule/sim/route_follower.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule::sim {
namespace {

constexpr double kAhead_m = 0.8;     // point that the robot heads for
constexpr double kArrived_m = 0.1;   // before the end of a line
constexpr double kBrake_mps2 = 0.4;  // so that it does not shoot past a corner
constexpr double kCreep_mps = 0.15;
constexpr double kYawGain_hz = 2.0;
constexpr double kMaxTurn_radps = 0.9;
constexpr double kTurned_rad = 0.03;
constexpr double kSharp_rad = 0.7;  // corners beyond this are taken on the spot

double turnRate(double error_rad) {
  return std::clamp(kYawGain_hz * error_rad, -kMaxTurn_radps, kMaxTurn_radps);
}

}  // namespace

void describe(ParamIo& io, Leg& leg) {
  const auto point = [&](const char* key, std::size_t size) -> std::optional<std::vector<double>> {
    if (!io.writing() && !io.has(key)) return std::nullopt;
    std::vector<double> values(size, 0.0);
    io.required(key, values, size, size);
    return values;
  };
  if (io.writing()) {
    if (leg.to) {
      std::vector<double> xy{leg.to->x, leg.to->y};
      io.required("to", xy, 2, 2);
    }
    if (leg.twist) {
      std::vector<double> vw{leg.twist->x(), leg.twist->y()};
      io.required("twist", vw, 2, 2);
    }
    if (leg.turn_to_rad) io.optionalDegrees("turn_to_deg", *leg.turn_to_rad);
  } else {
    if (const auto xy = point("to", 2)) leg.to = Point2{(*xy)[0], (*xy)[1]};
    if (const auto vw = point("twist", 2)) leg.twist = Eigen::Vector2d{(*vw)[0], (*vw)[1]};
    double yaw_rad = 0.0;
    io.optionalDegrees("turn_to_deg", yaw_rad);
    if (io.has("turn_to_deg")) leg.turn_to_rad = yaw_rad;
  }
  io.optional("wait_s", leg.wait_s, nonNegative());
  io.optional("for_s", leg.for_s, nonNegative());
  io.optional("speed_mps", leg.speed_mps, positive());
  io.optional("reverse", leg.reverse);
  if (io.writing()) return;
  const int kinds =
      (leg.to ? 1 : 0) + (leg.turn_to_rad ? 1 : 0) + (leg.wait_s ? 1 : 0) + (leg.twist ? 1 : 0);
  if (kinds != 1) io.problem("", "a leg has exactly one of to, turn_to_deg, wait_s, twist");
  if (leg.twist && leg.for_s <= 0.0) io.problem("twist", "needs for_s > 0");
}

RouteFollower::RouteFollower(std::vector<Leg> legs, const Pose2& T_map_base, bool turns_on_the_spot)
    : legs_(std::move(legs)),
      turns_on_the_spot_(turns_on_the_spot),
      leg_start_{T_map_base.x, T_map_base.y},
      turning_(true) {}

void RouteFollower::nextLeg(const Pose2& T_map_base) {
  const auto& done = legs_[next_];
  leg_start_ = done.to ? *done.to : Point2{T_map_base.x, T_map_base.y};
  leg_s_ = 0.0;
  turning_ = true;
  ++next_;
}

VelocityCommand RouteFollower::alongLine(const Leg& leg, const Pose2& T_map_base) {
  const Point2 end = *leg.to;
  const Point2 along{end.x - leg_start_.x, end.y - leg_start_.y};
  const double length_m = std::max(std::hypot(along.x, along.y), 1e-9);
  const Point2 unit{along.x / length_m, along.y / length_m};
  const Point2 here{T_map_base.x - leg_start_.x, T_map_base.y - leg_start_.y};
  const double covered_m = here.x * unit.x + here.y * unit.y;
  const double left_m = length_m - covered_m;
  if (left_m <= kArrived_m) {
    nextLeg(T_map_base);
    return {};
  }
  const double ahead_m = covered_m + kAhead_m;  // also beyond the end: keeps the course
  const Point2 target{leg_start_.x + ahead_m * unit.x, leg_start_.y + ahead_m * unit.y};
  double course_rad = std::atan2(target.y - T_map_base.y, target.x - T_map_base.x);
  if (leg.reverse) course_rad = wrapToPi(course_rad + kPi);
  const double error_rad = angleDiff(course_rad, T_map_base.phi);
  if (turns_on_the_spot_ && turning_) {
    const double settled_rad = std::abs(error_rad) > kSharp_rad ? 0.0 : kSharp_rad;
    if (std::abs(error_rad) > std::max(settled_rad, 5.0 * kTurned_rad)) {
      return {0.0, turnRate(error_rad)};
    }
    turning_ = false;
  }
  const bool last = next_ + 1 == legs_.size();
  const bool stops = last || !legs_[next_ + 1].to;
  double corner_rad = 0.0;
  if (!stops) {
    const Point2 next = *legs_[next_ + 1].to;
    corner_rad =
        std::abs(angleDiff(std::atan2(next.y - end.y, next.x - end.x), std::atan2(unit.y, unit.x)));
  }
  double speed_mps = leg.speed_mps;
  if (stops || (turns_on_the_spot_ && corner_rad > kSharp_rad)) {
    speed_mps = std::min(speed_mps, std::sqrt(2.0 * kBrake_mps2 * left_m));
  }
  speed_mps *= std::max(0.3, std::cos(error_rad));
  speed_mps = std::max(speed_mps, std::min(kCreep_mps, leg.speed_mps));
  return {leg.reverse ? -speed_mps : speed_mps, turnRate(error_rad)};
}

VelocityCommand RouteFollower::step(const Pose2& T_map_base, Duration dt) {
  if (finished()) return {};
  const Leg& leg = legs_[next_];
  leg_s_ += toSeconds(dt);
  if (leg.to) return alongLine(leg, T_map_base);
  if (leg.turn_to_rad) {
    const double error_rad = angleDiff(*leg.turn_to_rad, T_map_base.phi);
    if (std::abs(error_rad) > kTurned_rad) return {0.0, turnRate(error_rad)};
    nextLeg(T_map_base);
    return {};
  }
  const double lasts_s = leg.wait_s ? *leg.wait_s : leg.for_s;
  VelocityCommand command;
  if (leg.twist) command = {leg.twist->x(), leg.twist->y()};
  if (leg_s_ >= lasts_s - 1e-9) nextLeg(T_map_base);
  return command;
}

}  // namespace vestibule::sim
