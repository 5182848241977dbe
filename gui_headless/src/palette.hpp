#pragma once

#include <string_view>

#include "vestibule/core/events.hpp"

namespace vestibule::gui_headless {

/// One set of colours for pictures, charts and pages, as "#rrggbb". The four modes stay apart for
/// the common kinds of colour blindness (blue and orange differ in hue, grey in saturation, red is
/// much darker than the orange).
namespace palette {
inline constexpr std::string_view kInk = "#1c2733";    ///< text, reference track
inline constexpr std::string_view kMuted = "#5f6b78";  ///< captions, axes
inline constexpr std::string_view kFaint = "#9aa5b1";  ///< raw fixes, small marks
inline constexpr std::string_view kLine = "#dfe4ea";   ///< grid lines, borders
inline constexpr std::string_view kPaper = "#ffffff";
inline constexpr std::string_view kGround = "#f3f5f8";     ///< unknown space
inline constexpr std::string_view kWall = "#5a6572";       ///< occupied cells
inline constexpr std::string_view kTruthWall = "#a3acb6";  ///< walls of the simulated world
inline constexpr std::string_view kBuilding = "#33414f";
inline constexpr std::string_view kDoor = "#0f8a5f";
inline constexpr std::string_view kParticle = "#7a4fb5";
inline constexpr std::string_view kOutdoor = "#0072b2";
inline constexpr std::string_view kIndoor = "#e8920c";
inline constexpr std::string_view kDeadReckoning = "#808a95";
inline constexpr std::string_view kLost = "#b0101f";
}  // namespace palette

[[nodiscard]] constexpr std::string_view colourOf(Mode mode) {
  switch (mode) {
    case Mode::kOutdoor:
      return palette::kOutdoor;
    case Mode::kIndoor:
      return palette::kIndoor;
    case Mode::kDeadReckoning:
      return palette::kDeadReckoning;
    case Mode::kLost:
      return palette::kLost;
  }
  return palette::kInk;
}

}  // namespace vestibule::gui_headless
