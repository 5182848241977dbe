#include "vestibule/core/time.hpp"

#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace vestibule {
namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr double kMaxSeconds = 9.2e9;

bool isDigits(std::string_view text) {
  for (const char c : text) {
    if (std::isdigit(static_cast<unsigned char>(c)) == 0) return false;
  }
  return true;
}

}  // namespace

Duration durationFromSeconds(double seconds) {
  return Duration(static_cast<std::int64_t>(std::llround(seconds * 1e9)));
}

Timestamp timestampFromSeconds(double seconds) {
  // Whole seconds apart from the fraction: the product of a Unix time and 1e9 has no exact double.
  const double whole = std::floor(seconds);
  const auto fraction_ns = static_cast<std::int64_t>(std::llround((seconds - whole) * 1e9));
  return {static_cast<std::int64_t>(whole) * kNsPerSecond + fraction_ns};
}

std::string formatSeconds(Timestamp t) {
  const bool negative = t.ns < 0;
  const std::uint64_t magnitude =
      negative ? ~static_cast<std::uint64_t>(t.ns) + 1U : static_cast<std::uint64_t>(t.ns);
  char buffer[40];
  std::snprintf(
      buffer,
      sizeof buffer,
      "%s%llu.%09llu",
      negative ? "-" : "",
      static_cast<unsigned long long>(magnitude / kNsPerSecond),
      static_cast<unsigned long long>(magnitude % kNsPerSecond));
  return buffer;
}

std::optional<Timestamp> parseSeconds(std::string_view text) {
  std::string_view rest = text;
  const bool negative = !rest.empty() && rest.front() == '-';
  if (!rest.empty() && (rest.front() == '-' || rest.front() == '+')) rest.remove_prefix(1);
  if (rest.empty()) return std::nullopt;

  if (rest.find_first_of("eE") != std::string_view::npos) {
    const std::string copy(text);
    char* end = nullptr;
    const double seconds = std::strtod(copy.c_str(), &end);
    if (end != copy.c_str() + copy.size() || !(std::abs(seconds) < kMaxSeconds)) {
      return std::nullopt;
    }
    return timestampFromSeconds(seconds);
  }

  const std::size_t dot = rest.find('.');
  const std::string_view whole = rest.substr(0, dot);
  std::string fraction(dot == std::string_view::npos ? std::string_view{} : rest.substr(dot + 1));
  if ((whole.empty() && fraction.empty()) || whole.size() > 10 || !isDigits(whole) ||
      !isDigits(fraction)) {
    return std::nullopt;
  }
  const bool round_up = fraction.size() > 9 && fraction[9] >= '5';
  fraction.resize(9, '0');
  std::int64_t ns = whole.empty() ? 0 : std::strtoll(std::string(whole).c_str(), nullptr, 10);
  if (ns > static_cast<std::int64_t>(kMaxSeconds)) return std::nullopt;
  ns = ns * kNsPerSecond + std::strtoll(fraction.c_str(), nullptr, 10) + (round_up ? 1 : 0);
  return Timestamp{negative ? -ns : ns};
}

}  // namespace vestibule
