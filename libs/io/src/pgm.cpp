#include "pgm.hpp"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <optional>

#include "vestibule/core/errors.hpp"

namespace vestibule::io {
namespace {

constexpr int kMaxValue = 65535;
constexpr int kMaxSide = 1'000'000;

/// The numbers of a Netpbm file, separated by white space; `#` begins a comment.
class Numbers {
 public:
  Numbers(const std::string& bytes, std::size_t begin) : bytes_(bytes), at_(begin) {}

  /// Empty at the end of the file, at anything else and beyond `most`.
  std::optional<int> next(int most) {
    while (at_ < bytes_.size() && (isSpace(bytes_[at_]) || bytes_[at_] == '#')) {
      if (bytes_[at_] == '#') {
        while (at_ < bytes_.size() && bytes_[at_] != '\n') ++at_;
      } else {
        ++at_;
      }
    }
    std::optional<int> value;
    while (at_ < bytes_.size() && std::isdigit(static_cast<unsigned char>(bytes_[at_])) != 0) {
      value = value.value_or(0) * 10 + (bytes_[at_++] - '0');
      if (*value > most) return std::nullopt;
    }
    return value;
  }
  /// Where the pixels of a binary file begin: one white space after the header.
  [[nodiscard]] std::size_t pixels() const { return at_ + 1; }

 private:
  static bool isSpace(char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; }

  const std::string& bytes_;
  std::size_t at_;
};

}  // namespace

bool looksLikePgm(const std::string& bytes) {
  return bytes.size() >= 2 && bytes[0] == 'P' && (bytes[1] == '2' || bytes[1] == '5');
}

cv::Mat decodePgm(const std::string& bytes, const std::string& where) {
  Numbers numbers(bytes, 2);
  const auto width = numbers.next(kMaxSide);
  const auto height = numbers.next(kMaxSide);
  const auto white = numbers.next(kMaxValue);
  if (!width || !height || !white || *width == 0 || *height == 0 || *white == 0) {
    throw InputError(
        where + ": not a PGM header (P2 or P5, width, height, white); export the map again");
  }
  const bool binary = bytes[1] == '5';
  const std::size_t size = *white > 255 ? 2 : 1;
  const std::size_t count = static_cast<std::size_t>(*width) * static_cast<std::size_t>(*height);
  const auto cutShort = [&](std::size_t there) {
    return InputError(
        where + ": cut short, " + std::to_string(there) + " of " + std::to_string(count) +
        " pixels; export the map again");
  };
  // Every pixel takes a byte at least: no memory for what the file cannot hold.
  const std::size_t begin = std::min(numbers.pixels(), bytes.size());
  const std::size_t room = (bytes.size() - begin) / (binary ? size : 1);
  if (room < count && binary) throw cutShort(room);
  if (room < count) throw InputError(where + ": cut short; export the map again");

  cv::Mat image(*height, *width, *white == 255 ? CV_8U : CV_16U);
  for (std::size_t i = 0; i < count; ++i) {
    int value = 0;
    if (binary) {
      for (std::size_t b = 0; b < size; ++b) {
        value = value * 256 + static_cast<unsigned char>(bytes[begin + i * size + b]);
      }
    } else if (const auto number = numbers.next(kMaxValue)) {
      value = *number;
    } else {
      throw cutShort(i);
    }
    const int row = static_cast<int>(i / static_cast<std::size_t>(*width));
    const int column = static_cast<int>(i % static_cast<std::size_t>(*width));
    value = std::min(value, *white);
    if (*white == 255) {
      image.at<std::uint8_t>(row, column) = static_cast<std::uint8_t>(value);
    } else {
      image.at<std::uint16_t>(row, column) =
          static_cast<std::uint16_t>((value * 65535LL + *white / 2) / *white);
    }
  }
  return image;
}

}  // namespace vestibule::io
