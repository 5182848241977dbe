#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "vestibule/core/events.hpp"

namespace vestibule::gui_headless {

/// Text for HTML and SVG content and attribute values: & < > " ' and control characters.
[[nodiscard]] std::string escape(std::string_view text);
[[nodiscard]] std::string base64(std::string_view bytes);
/// printf %.*f without a negative zero; "-" for a number that is not finite.
[[nodiscard]] std::string fixed(double value, int decimals);
/// Short decimal for coordinates and tick labels: up to `decimals` digits, trailing zeros cut.
[[nodiscard]] std::string compact(double value, int decimals);
/// Whole number with thousands separated by thin spaces for HTML.
[[nodiscard]] std::string grouped(std::size_t value);
/// 7-bit text for OpenCV's stroke fonts: common Latin letters lose their accents, others become ?.
[[nodiscard]] std::string asciiText(std::string_view utf8);

/// 1, 2 or 5 times a power of ten, at least `raw`. \pre raw > 0
[[nodiscard]] double niceStep(double raw);
/// Round ticks within [low, high], about `wanted` of them; `decimals` is what their labels need.
struct Ticks {
  std::vector<double> values;
  double step = 1.0;
  int decimals = 0;
};
[[nodiscard]] Ticks niceTicks(double low, double high, int wanted);

/// "dead reckoning" for people.
[[nodiscard]] std::string modeName(Mode mode);

}  // namespace vestibule::gui_headless
