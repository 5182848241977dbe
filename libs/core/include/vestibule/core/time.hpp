#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace vestibule {

using Duration = std::chrono::nanoseconds;

/// A point in data time: integer nanoseconds since the recording's own epoch (Unix time for most
/// recordings, seconds since start for some text files). Zero is a valid stamp.
struct Timestamp {
  std::int64_t ns = 0;

  friend constexpr bool operator==(Timestamp a, Timestamp b) { return a.ns == b.ns; }
  friend constexpr bool operator!=(Timestamp a, Timestamp b) { return a.ns != b.ns; }
  friend constexpr bool operator<(Timestamp a, Timestamp b) { return a.ns < b.ns; }
  friend constexpr bool operator<=(Timestamp a, Timestamp b) { return a.ns <= b.ns; }
  friend constexpr bool operator>(Timestamp a, Timestamp b) { return a.ns > b.ns; }
  friend constexpr bool operator>=(Timestamp a, Timestamp b) { return a.ns >= b.ns; }
  friend constexpr Duration operator-(Timestamp a, Timestamp b) { return Duration(a.ns - b.ns); }
  friend constexpr Timestamp operator+(Timestamp a, Duration d) { return {a.ns + d.count()}; }
  friend constexpr Timestamp operator-(Timestamp a, Duration d) { return {a.ns - d.count()}; }
};

/// Seconds of a duration; only for use inside formulas.
[[nodiscard]] constexpr double toSeconds(Duration d) {
  return static_cast<double>(d.count()) * 1e-9;
}

/// Seconds since the epoch. Loses sub-microsecond digits for Unix times: use formatSeconds for
/// text.
[[nodiscard]] constexpr double toSeconds(Timestamp t) { return static_cast<double>(t.ns) * 1e-9; }

/// \pre |seconds| < 9.2e9. Rounds to the nearest nanosecond.
[[nodiscard]] Duration durationFromSeconds(double seconds);
[[nodiscard]] Timestamp timestampFromSeconds(double seconds);

/// Decimal seconds with nine digits, exact: "976052857.337284000". Negative stamps keep their sign.
[[nodiscard]] std::string formatSeconds(Timestamp t);

/// Inverse of formatSeconds; reads any plain decimal or exponent notation without losing
/// nanoseconds to double rounding. Empty for anything else (NaN, text, out of range).
[[nodiscard]] std::optional<Timestamp> parseSeconds(std::string_view text);

}  // namespace vestibule
