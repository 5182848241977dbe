#pragma once

#include <string>

#include "vestibule/mrpt_adapters/reactive_driver.hpp"

namespace vestibule::mrpt_adapters {

/// The text of an MRPT configuration file for the reactive navigator.
[[nodiscard]] std::string reactiveConfig(const ReactiveParams& params);

}  // namespace vestibule::mrpt_adapters
