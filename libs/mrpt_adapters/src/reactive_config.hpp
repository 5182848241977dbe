#pragma once

#include <string>

#include "vestibule/mrpt_adapters/reactive_driver.hpp"

namespace vestibule::mrpt_adapters {

/// The text of an MRPT configuration file for the reactive navigator.
///
/// \param cache_folder where MRPT writes its collision tables
[[nodiscard]] std::string reactiveConfig(
    const ReactiveParams& params, const std::string& cache_folder);

}  // namespace vestibule::mrpt_adapters
