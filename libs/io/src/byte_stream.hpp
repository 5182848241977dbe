#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "vestibule/core/time.hpp"

namespace vestibule::io {

/// Bytes of a recording, decompressed. Throws InputError naming the file when compressed data are
/// damaged or end early.
class ByteStream {
 public:
  ByteStream() = default;
  ByteStream(const ByteStream&) = delete;
  ByteStream& operator=(const ByteStream&) = delete;
  virtual ~ByteStream() = default;

  /// Up to `size` bytes; 0 only at the end.
  virtual std::size_t read(char* buffer, std::size_t size) = 0;
  /// Share of the (compressed) input consumed, 0..1.
  [[nodiscard]] virtual double progress() const = 0;
  virtual void rewind() = 0;
  [[nodiscard]] virtual const std::string& name() const = 0;
};

/// Plain, gz or bz2, recognised by content. Throws InputError for a missing, unreadable or empty
/// file.
[[nodiscard]] std::unique_ptr<ByteStream> openFile(const std::string& path);
/// A text in memory, under a name for messages.
[[nodiscard]] std::unique_ptr<ByteStream> openMemory(std::string text, std::string name);

/// Lines of a stream, without their end ("\n" or "\r\n"). A line over 1 MB is an InputError.
class LineReader {
 public:
  explicit LineReader(std::unique_ptr<ByteStream> stream);

  /// False at the end. The view lives until the next call.
  bool next(std::string_view& line);
  [[nodiscard]] std::size_t lineNumber() const { return line_number_; }
  /// "file:line" of the line read last.
  [[nodiscard]] std::string where() const;
  [[nodiscard]] double progress() const { return stream_->progress(); }
  [[nodiscard]] const std::string& name() const { return stream_->name(); }
  void rewind();

 private:
  std::unique_ptr<ByteStream> stream_;
  std::string buffer_;
  std::size_t begin_ = 0;
  bool at_end_ = false;
  std::size_t line_number_ = 0;
};

/// Things met and survived, counted per kind.
class Notes {
 public:
  void add(const std::string& text, std::size_t number);
  /// "NEFF lines ignored: 406 (first at line 123)" with `unit` = "line".
  [[nodiscard]] std::vector<std::string> texts(const std::string& unit) const;

 private:
  std::map<std::string, std::pair<std::size_t, std::size_t>> counts_;  // count, first
};

/// The words of a line, separated by blanks or tabs.
void splitWords(std::string_view line, std::vector<std::string_view>& words);
/// A whole word as a number; empty for anything else. Accepts "nan" and "inf".
[[nodiscard]] bool parseNumber(std::string_view word, double& value);
/// A stamp in seconds as parseSeconds reads it, within +-146 years: the difference of any two then
/// fits 64 bits of nanoseconds.
[[nodiscard]] std::optional<Timestamp> parseStamp(std::string_view word);
[[nodiscard]] bool isPlausible(Timestamp stamp);
/// A word shortened for a message, unprintable bytes replaced.
[[nodiscard]] std::string quoted(std::string_view word, std::size_t max_size = 40);

}  // namespace vestibule::io
