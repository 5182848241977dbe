#pragma once

#include <optional>
#include <variant>
#include <vector>

#include "vestibule/ekf/filter.hpp"

namespace vestibule::ekf {

/// Why a heading reading is not looked at: the error of the last one is still the same.
inline constexpr char kTooSoon[] = "too soon";

struct PoseInput {
  Timestamp stamp;
  PoseWithCovariance T_map_base;
};
/// The velocity of a fix, after its position.
struct VelocityInput {
  Timestamp stamp;
  GnssVelocity velocity;
};
struct ResetInput {
  Timestamp stamp;
  PoseWithCovariance T_map_base;
};
/// What a filter is fed. At equal stamps the order of the alternatives counts: inertial data carry
/// the filter to the stamp.
using Input =
    std::variant<Imu, Heading, WheelOdometry, MapFix, VelocityInput, PoseInput, ResetInput>;

[[nodiscard]] Timestamp stampOf(const Input& input);
/// Why an input cannot be used at all, whatever the filter believes; empty when it can.
[[nodiscard]] const char* unusable(const Input& input);
/// A total order that does not depend on arrival: stamp, kind, content.
/// \return negative, zero (the same measurement) or positive
[[nodiscard]] int compare(const Input& a, const Input& b);

}  // namespace vestibule::ekf
