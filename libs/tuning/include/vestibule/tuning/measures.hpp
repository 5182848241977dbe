#pragma once

#include <string_view>

#include "vestibule/tuning/session.hpp"

namespace vestibule::tuning {

/// "m", or "" where it has none.
[[nodiscard]] std::string_view unitOf(Measure measure);

/// Whether nothing but the odometry filter is measured: then its path is the one to show.
[[nodiscard]] bool measuresOdometryAlone(const Session& session);

}  // namespace vestibule::tuning
