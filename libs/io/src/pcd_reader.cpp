#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <optional>
#include <sstream>

#include "byte_stream.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/io/sweep_io.hpp"

namespace vestibule::io {
namespace {

constexpr std::size_t kMaxPoints = 100'000'000;
constexpr std::size_t kMaxPointBytes = 4096;

struct Field {
  std::string name;
  std::size_t size = 4;
  char type = 'F';
  std::size_t count = 1;
  std::size_t offset = 0;  // in bytes, within a point
  std::size_t column = 0;  // among the words of an ASCII point
};

struct Header {
  std::vector<Field> fields;
  std::size_t points = 0;
  std::size_t point_bytes = 0;
  std::size_t columns = 0;
  std::string data;  // ascii, binary, binary_compressed

  [[nodiscard]] const Field* field(std::string_view name) const {
    const auto it =
        std::find_if(fields.begin(), fields.end(), [&](const Field& f) { return f.name == name; });
    return it == fields.end() ? nullptr : &*it;
  }
};

/// A whole PCD file in memory, taken line by line and then as bytes.
class PcdText {
 public:
  explicit PcdText(const std::string& path) : path_(path) {
    const auto stream = openFile(path);
    std::string block(1U << 16U, '\0');
    while (const std::size_t n = stream->read(block.data(), block.size())) {
      bytes_.append(block, 0, n);
    }
  }
  std::optional<std::string_view> line() {
    if (position_ >= bytes_.size()) return std::nullopt;
    ++line_;
    const std::size_t end = std::min(bytes_.find('\n', position_), bytes_.size());
    std::string_view text(bytes_.data() + position_, end - position_);
    position_ = end + 1;
    if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
    return text;
  }
  [[nodiscard]] std::string_view rest() const {
    return std::string_view(bytes_).substr(std::min(position_, bytes_.size()));
  }
  [[noreturn]] void fail(const std::string& problem) const {
    throw InputError(path_ + ":" + std::to_string(line_) + ": " + problem);
  }
  [[noreturn]] void failAtPoint(std::size_t point, const std::string& problem) const {
    throw InputError(path_ + ": point " + std::to_string(point) + ": " + problem);
  }

 private:
  std::string path_;
  std::string bytes_;
  std::size_t position_ = 0;
  std::size_t line_ = 0;
};

std::size_t wholeNumber(const PcdText& text, std::string_view word, std::size_t limit) {
  double value = 0.0;
  if (!parseNumber(word, value) || !(value >= 0.0) || value > static_cast<double>(limit) ||
      value != std::floor(value)) {
    text.fail(quoted(word) + " is no whole number up to " + std::to_string(limit));
  }
  return static_cast<std::size_t>(value);
}

Header readHeader(PcdText& text) {
  Header header;
  std::vector<std::string_view> words;
  const auto perField = [&](const auto& set) {
    if (words.size() != header.fields.size() + 1) {
      text.fail(
          std::string(words[0]) + " has " + std::to_string(words.size() - 1) + " words for " +
          std::to_string(header.fields.size()) + " FIELDS");
    }
    for (std::size_t i = 0; i < header.fields.size(); ++i) set(header.fields[i], words[i + 1]);
  };
  while (header.data.empty()) {
    const auto line = text.line();
    if (!line) text.fail("end of the file without a DATA line; not a PCD file, or it is cut off");
    splitWords(*line, words);
    if (words.empty() || words[0].front() == '#') continue;
    const std::string_view key = words[0];
    if (words.size() < 2 && key != "VERSION") text.fail("line without a value: " + quoted(key));
    if (key == "FIELDS") {
      for (std::size_t i = 1; i < words.size(); ++i) {
        header.fields.push_back({std::string(words[i])});
      }
    } else if (key == "SIZE") {
      perField([&](Field& f, std::string_view w) { f.size = wholeNumber(text, w, 8); });
    } else if (key == "TYPE") {
      perField([&](Field& f, std::string_view w) { f.type = w.front(); });
    } else if (key == "COUNT") {
      perField([&](Field& f, std::string_view w) { f.count = wholeNumber(text, w, 1024); });
    } else if (key == "POINTS") {
      header.points = wholeNumber(text, words[1], kMaxPoints);
    } else if (key == "DATA") {
      header.data = std::string(words[1]);
    } else if (key != "VERSION" && key != "WIDTH" && key != "HEIGHT" && key != "VIEWPOINT") {
      text.fail("unknown header line " + quoted(key) + "; not a PCD file, or it is damaged");
    }
  }
  for (Field& f : header.fields) {
    f.offset = header.point_bytes;
    f.column = header.columns;
    header.point_bytes += f.size * f.count;
    header.columns += f.count;
  }
  for (const char* name : {"x", "y", "z"}) {
    if (header.field(name) == nullptr) text.fail("no field '" + std::string(name) + "' in FIELDS");
  }
  if (header.point_bytes > kMaxPointBytes) text.fail("points of more than 4096 bytes");
  if (header.data != "ascii" && header.data != "binary" && header.data != "binary_compressed") {
    text.fail("DATA " + quoted(header.data) + " is none of ascii, binary, binary_compressed");
  }
  return header;
}

template <class T>
double as(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<double>(value);
}

/// Empty for a type that the format does not have.
std::optional<double> valueOf(const Field& f, const char* bytes) {
  switch (f.type) {
    case 'F':
      if (f.size == 4) return as<float>(bytes);
      if (f.size == 8) return as<double>(bytes);
      return std::nullopt;
    case 'U':
      if (f.size == 1) return as<std::uint8_t>(bytes);
      if (f.size == 2) return as<std::uint16_t>(bytes);
      if (f.size == 4) return as<std::uint32_t>(bytes);
      return std::nullopt;
    case 'I':
      if (f.size == 1) return as<std::int8_t>(bytes);
      if (f.size == 2) return as<std::int16_t>(bytes);
      if (f.size == 4) return as<std::int32_t>(bytes);
      return std::nullopt;
    default:
      return std::nullopt;
  }
}

/// LZF, as written by LibLZF: literal runs and back references. Empty when the data are damaged.
std::optional<std::string> unpackLzf(std::string_view in, std::size_t size) {
  std::string out;
  out.reserve(size);
  std::size_t i = 0;
  while (i < in.size()) {
    const auto control = static_cast<unsigned char>(in[i++]);
    if (control < 32U) {
      const std::size_t run = control + 1U;
      if (i + run > in.size() || out.size() + run > size) return std::nullopt;
      out.append(in.substr(i, run));
      i += run;
      continue;
    }
    std::size_t length = control >> 5U;
    if (length == 7U) {
      if (i >= in.size()) return std::nullopt;
      length += static_cast<unsigned char>(in[i++]);
    }
    if (i >= in.size()) return std::nullopt;
    const std::size_t back =
        ((control & 0x1FU) << 8U) + static_cast<unsigned char>(in[i++]) + std::size_t{1};
    length += 2;
    if (back > out.size() || out.size() + length > size) return std::nullopt;
    for (std::size_t k = 0; k < length; ++k) out.push_back(out[out.size() - back]);
  }
  if (out.size() != size) return std::nullopt;
  return out;
}

/// The values of one field of one point, wherever they lie.
using Getter = std::function<double(const Field&, std::size_t)>;

void collect(const Header& header, const PcdText& text, const Getter& get, LidarSweep& sweep) {
  const Field* ring = header.field("ring");
  const Field* time = header.field("t") != nullptr ? header.field("t") : header.field("time");
  // Nanoseconds in a whole number, as some drivers write them.
  const double unit_s = time != nullptr && time->type != 'F' ? 1e-9 : 1.0;
  for (std::size_t i = 0; i < header.points; ++i) {
    const Eigen::Vector3d p(
        get(*header.field("x"), i), get(*header.field("y"), i), get(*header.field("z"), i));
    if (!p.allFinite()) continue;
    LidarSweep::Point point;
    point.p_laser = p.cast<float>();
    if (ring != nullptr) {
      const double r = get(*ring, i);
      if (!(r >= 0.0 && r < 1e6)) text.failAtPoint(i + 1, "ring is out of range");
      point.ring = static_cast<int>(r);
    }
    if (time != nullptr) point.time_offset_s = static_cast<float>(unit_s * get(*time, i));
    sweep.points.push_back(point);
  }
}

void readAscii(const Header& header, PcdText& text, LidarSweep& sweep) {
  std::vector<std::vector<double>> rows;
  std::vector<std::string_view> words;
  while (rows.size() < header.points) {
    const auto line = text.line();
    if (!line) {
      text.fail(
          "end of the file after " + std::to_string(rows.size()) + " of " +
          std::to_string(header.points) + " points; it is cut off");
    }
    splitWords(*line, words);
    if (words.empty()) continue;
    if (words.size() != header.columns) {
      text.fail(
          "point of " + std::to_string(words.size()) + " words instead of " +
          std::to_string(header.columns));
    }
    std::vector<double>& row = rows.emplace_back(words.size());
    for (std::size_t i = 0; i < words.size(); ++i) {
      if (!parseNumber(words[i], row[i])) text.fail(quoted(words[i]) + " is no number");
    }
  }
  collect(
      header, text, [&](const Field& f, std::size_t i) { return rows[i][f.column]; }, sweep);
}

void readBinary(const Header& header, const PcdText& text, LidarSweep& sweep) {
  std::string unpacked;
  std::string_view bytes = text.rest();
  const bool by_field = header.data == "binary_compressed";
  const std::size_t size = header.points * header.point_bytes;
  if (by_field) {
    if (bytes.size() < 8) text.fail("cut off after the header");
    std::uint32_t packed_size = 0;
    std::uint32_t full_size = 0;
    std::memcpy(&packed_size, bytes.data(), 4);
    std::memcpy(&full_size, bytes.data() + 4, 4);
    if (full_size != size || packed_size > bytes.size() - 8) {
      text.fail("compressed data of another size than the header says; damaged or cut off");
    }
    auto data = unpackLzf(bytes.substr(8, packed_size), size);
    if (!data) text.fail("damaged compressed data");
    unpacked = std::move(*data);
    bytes = unpacked;
  }
  if (bytes.size() < size) {
    text.fail(
        "end of the file after " + std::to_string(bytes.size() / header.point_bytes) + " of " +
        std::to_string(header.points) + " points; it is cut off");
  }
  for (const Field& f : header.fields) {
    const bool used = f.name == "x" || f.name == "y" || f.name == "z" || f.name == "ring" ||
                      f.name == "t" || f.name == "time";
    const std::string zeros(8, '\0');
    if (used && (f.count < 1 || !valueOf(f, zeros.data()))) {
      text.fail("field '" + f.name + "' has no number type that PCD knows");
    }
  }
  // Compressed files hold one field after the other, plain ones one point after the other.
  collect(
      header,
      text,
      [&](const Field& f, std::size_t i) {
        const std::size_t at = by_field ? f.offset * header.points + i * f.size * f.count
                                        : i * header.point_bytes + f.offset;
        return valueOf(f, bytes.data() + at).value();
      },
      sweep);
}

}  // namespace

LidarSweep readPcd(const std::string& path, const Pose3& T_base_laser) {
  PcdText text(path);
  const Header header = readHeader(text);
  LidarSweep sweep;
  sweep.T_base_laser = T_base_laser;
  if (header.data == "ascii") {
    readAscii(header, text, sweep);
  } else {
    readBinary(header, text, sweep);
  }
  return sweep;
}

}  // namespace vestibule::io
