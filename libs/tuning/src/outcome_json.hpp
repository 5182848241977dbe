#pragma once

#include <nlohmann/json.hpp>

#include "vestibule/tuning/subject.hpp"

namespace vestibule::tuning {

/// {"failure": ..., "scores": [[[block, value], ...] per objective]}; numbers come back the same to
/// the last bit, what is not finite comes back as NaN.
[[nodiscard]] nlohmann::ordered_json toJson(const Outcome& outcome);
[[nodiscard]] Outcome outcomeFrom(const nlohmann::ordered_json& json);

}  // namespace vestibule::tuning
