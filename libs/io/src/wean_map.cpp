#include "wean_map.hpp"

#include <cmath>
#include <vector>

#include "vestibule/core/errors.hpp"

namespace vestibule::io {
namespace {

using grid::Cell;

constexpr std::string_view kKeyPrefix = "robot_specifications->";
constexpr std::string_view kResolutionKey = "robot_specifications->resolution";
constexpr std::string_view kMapKey = "global_map[0]:";
constexpr double kMaxSide = 20000.0;

// What is neither clearly free nor clearly occupied was seen both ways.
constexpr double kFreeAbove = 0.85;
constexpr double kOccupiedBelow = 0.4;

Cell cellOf(double p_free) {
  if (p_free < 0.0) return Cell::kUnknown;
  if (p_free > kFreeAbove) return Cell::kFree;
  return p_free < kOccupiedBelow ? Cell::kOccupied : Cell::kUnknown;
}

[[noreturn]] void fail(const LineReader& lines, const std::string& what) {
  throw InputError(lines.where() + ": " + what + "; the map is cut off or damaged here");
}

double positive(const LineReader& lines, std::string_view word, double max) {
  double value = 0.0;
  if (!parseNumber(word, value) || !(value > 0.0) || value > max) {
    fail(lines, quoted(word) + " is not a number between 0 and " + std::to_string(max));
  }
  return value;
}

}  // namespace

grid::OccupancyMap readWeanMap(std::unique_ptr<ByteStream> stream) {
  LineReader lines(std::move(stream));
  std::string_view text;
  std::vector<std::string_view> words;
  double resolution_m = 0.0;
  int width = 0;
  int height = 0;
  while (width == 0 && lines.next(text)) {
    splitWords(text, words);
    if (words.size() == 2 && words[0] == kResolutionKey) {
      resolution_m = 0.01 * positive(lines, words[1], 1e4);
    } else if (words.size() == 3 && words[0] == kMapKey) {
      width = static_cast<int>(positive(lines, words[1], kMaxSide));
      height = static_cast<int>(positive(lines, words[2], kMaxSide));
    }
  }
  if (width == 0 || height == 0) fail(lines, "no '" + std::string(kMapKey) + " WIDTH HEIGHT'");
  if (!(resolution_m > 0.0)) fail(lines, "no '" + std::string(kResolutionKey) + "' before the map");

  std::vector<Cell> cells;
  for (int ix = 0; ix < width; ++ix) {
    if (!lines.next(text)) {
      fail(lines, "the map ends after " + std::to_string(ix) + " of " + std::to_string(width));
    }
    splitWords(text, words);
    if (words.size() != static_cast<std::size_t>(height)) {
      fail(lines, std::to_string(words.size()) + " numbers instead of " + std::to_string(height));
    }
    // Not before the first line was sound: a damaged size must not take all memory.
    if (cells.empty()) {
      cells.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    }
    for (int iy = 0; iy < height; ++iy) {
      double p_free = 0.0;
      const std::string_view word = words[static_cast<std::size_t>(iy)];
      if (!parseNumber(word, p_free) || !std::isfinite(p_free)) {
        fail(lines, quoted(word) + " is not a number");
      }
      cells
          [static_cast<std::size_t>(iy) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(ix)] = cellOf(p_free);
    }
  }
  return grid::OccupancyMap::fromCells(width, height, resolution_m, {0.0, 0.0}, cells);
}

bool looksLikeWeanMap(LineReader lines) {
  std::string_view text;
  if (!lines.next(text)) return false;
  return text.substr(0, kKeyPrefix.size()) == kKeyPrefix ||
         text.substr(0, kMapKey.size()) == kMapKey;
}

}  // namespace vestibule::io
