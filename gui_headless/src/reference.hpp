#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/gui_headless/run_recorder.hpp"
#include "vestibule/gui_headless/scene.hpp"

namespace vestibule::gui_headless {

using StampedPoses = std::vector<std::pair<Timestamp, Pose2>>;

/// The scene's reference, or the recorded truth where the scene has none; stamps ascending.
[[nodiscard]] StampedPoses referenceOf(const RunRecorder& run, const Scene& scene);

/// Reference pose at a time, between two rows at most 3 s apart; empty in gaps and outside.
[[nodiscard]] std::optional<Pose2> referenceAt(const StampedPoses& reference, Timestamp stamp);

/// A time at which the trajectory went through a door.
struct DoorCrossing {
  Timestamp stamp;
  std::string door;
};
[[nodiscard]] std::vector<DoorCrossing> doorCrossings(
    const std::vector<PoseSample>& poses, const geo::Site& site);

}  // namespace vestibule::gui_headless
