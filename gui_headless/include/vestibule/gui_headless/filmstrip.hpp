#pragma once

#include <string>

#include "vestibule/gui_headless/run_recorder.hpp"
#include "vestibule/gui_headless/scene.hpp"

namespace vestibule::gui_headless {

/// The particles over time: up to eight moments side by side, each zoomed to its cloud, with the
/// prior map and the beams that ended on things which are not in it.
/// \return PNG bytes; empty when the run has no particles
[[nodiscard]] std::string renderFilmstrip(const RunRecorder& run, const Scene& scene);

}  // namespace vestibule::gui_headless
