#include "byte_stream.hpp"

#include <bzlib.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "vestibule/core/errors.hpp"

namespace vestibule::io {
namespace {

constexpr std::size_t kMaxLineBytes = 1U << 20U;
constexpr std::size_t kChunkBytes = 1U << 16U;

[[noreturn]] void throwDamaged(const std::string& path, const std::string& what) {
  throw InputError(
      path + ": compressed data damaged or cut off (" + what + "); copy or download it again");
}

/// Plain files too: zlib hands them through.
class GzStream : public ByteStream {
 public:
  GzStream(const std::string& path, std::uintmax_t size) : path_(path), size_(size) { open(); }
  ~GzStream() override { gzclose(file_); }

  std::size_t read(char* buffer, std::size_t size) override {
    const int n = gzread(file_, buffer, static_cast<unsigned>(size));
    int code = Z_OK;
    const char* text = gzerror(file_, &code);
    // A cut-off gz file first delivers what it has, with Z_BUF_ERROR set.
    if (n < 0 || code != Z_OK) throwDamaged(path_, text);
    return static_cast<std::size_t>(n);
  }
  [[nodiscard]] double progress() const override {
    return std::min(1.0, static_cast<double>(gzoffset(file_)) / static_cast<double>(size_));
  }
  void rewind() override {
    gzclose(file_);
    open();
  }
  [[nodiscard]] const std::string& name() const override { return path_; }

 private:
  void open() {
    file_ = gzopen(path_.c_str(), "rb");
    if (file_ == nullptr) throw InputError(path_ + ": cannot be opened: " + std::strerror(errno));
    gzbuffer(file_, kChunkBytes);
  }

  std::string path_;
  std::uintmax_t size_;
  gzFile file_ = nullptr;
};

class Bz2Stream : public ByteStream {
 public:
  Bz2Stream(const std::string& path, std::uintmax_t size)
      : path_(path), size_(size), input_(kChunkBytes) {
    file_ = std::fopen(path.c_str(), "rb");
    if (file_ == nullptr) throw InputError(path + ": cannot be opened: " + std::strerror(errno));
    start();
  }
  ~Bz2Stream() override {
    BZ2_bzDecompressEnd(&state_);
    std::fclose(file_);
  }

  std::size_t read(char* buffer, std::size_t size) override {
    state_.next_out = buffer;
    state_.avail_out = static_cast<unsigned>(size);
    while (state_.avail_out == size && !at_end_) {
      if (state_.avail_in == 0) {
        const std::size_t n = std::fread(input_.data(), 1, input_.size(), file_);
        consumed_ += n;
        state_.next_in = input_.data();
        state_.avail_in = static_cast<unsigned>(n);
        if (n == 0) {
          if (!between_streams_) throwDamaged(path_, "unexpected end");
          at_end_ = true;
          break;
        }
      }
      if (between_streams_) {
        // Parallel compressors write several streams one after the other.
        restartStream();
        between_streams_ = false;
      }
      const int code = BZ2_bzDecompress(&state_);
      if (code == BZ_STREAM_END) {
        between_streams_ = true;
      } else if (code != BZ_OK) {
        throwDamaged(path_, "bzip2 code " + std::to_string(code));
      }
    }
    return size - state_.avail_out;
  }
  [[nodiscard]] double progress() const override {
    return std::min(1.0, static_cast<double>(consumed_) / static_cast<double>(size_));
  }
  void rewind() override {
    std::rewind(file_);
    BZ2_bzDecompressEnd(&state_);
    consumed_ = 0;
    at_end_ = false;
    between_streams_ = false;
    start();
  }
  [[nodiscard]] const std::string& name() const override { return path_; }

 private:
  void start() {
    state_ = {};
    if (BZ2_bzDecompressInit(&state_, 0, 0) != BZ_OK) throwDamaged(path_, "bzip2 start");
  }
  void restartStream() {
    const bz_stream before = state_;
    BZ2_bzDecompressEnd(&state_);
    start();
    state_.next_in = before.next_in;
    state_.avail_in = before.avail_in;
    state_.next_out = before.next_out;
    state_.avail_out = before.avail_out;
  }

  std::string path_;
  std::uintmax_t size_;
  std::FILE* file_ = nullptr;
  bz_stream state_{};
  std::vector<char> input_;
  std::uintmax_t consumed_ = 0;
  bool at_end_ = false;
  bool between_streams_ = false;
};

/// A gz inside the stream: some recordings were compressed twice.
class NestedGzStream : public ByteStream {
 public:
  explicit NestedGzStream(std::unique_ptr<ByteStream> inner)
      : inner_(std::move(inner)), input_(kChunkBytes) {
    start();
  }
  ~NestedGzStream() override { inflateEnd(&state_); }

  std::size_t read(char* buffer, std::size_t size) override {
    state_.next_out = reinterpret_cast<Bytef*>(buffer);
    state_.avail_out = static_cast<unsigned>(size);
    while (state_.avail_out == size && !at_end_) {
      if (state_.avail_in == 0) {
        const std::size_t n = inner_->read(input_.data(), input_.size());
        if (n == 0) throwDamaged(name(), "unexpected end");
        state_.next_in = reinterpret_cast<Bytef*>(input_.data());
        state_.avail_in = static_cast<unsigned>(n);
      }
      const int code = inflate(&state_, Z_NO_FLUSH);
      if (code == Z_STREAM_END) {
        at_end_ = true;
      } else if (code != Z_OK) {
        throwDamaged(
            name(), state_.msg != nullptr ? state_.msg : "zlib code " + std::to_string(code));
      }
    }
    return size - state_.avail_out;
  }
  [[nodiscard]] double progress() const override { return inner_->progress(); }
  void rewind() override {
    inner_->rewind();
    inflateEnd(&state_);
    at_end_ = false;
    start();
  }
  [[nodiscard]] const std::string& name() const override { return inner_->name(); }

 private:
  void start() {
    constexpr int kGzWindow = 15 + 16;
    state_ = {};
    if (inflateInit2(&state_, kGzWindow) != Z_OK) throwDamaged(name(), "zlib start");
  }

  std::unique_ptr<ByteStream> inner_;
  z_stream state_{};
  std::vector<char> input_;
  bool at_end_ = false;
};

class MemoryStream : public ByteStream {
 public:
  MemoryStream(std::string text, std::string name)
      : text_(std::move(text)), name_(std::move(name)) {}

  std::size_t read(char* buffer, std::size_t size) override {
    const std::size_t n = std::min(size, text_.size() - position_);
    std::memcpy(buffer, text_.data() + position_, n);
    position_ += n;
    return n;
  }
  [[nodiscard]] double progress() const override {
    return text_.empty() ? 1.0 : static_cast<double>(position_) / static_cast<double>(text_.size());
  }
  void rewind() override { position_ = 0; }
  [[nodiscard]] const std::string& name() const override { return name_; }

 private:
  std::string text_;
  std::string name_;
  std::size_t position_ = 0;
};

}  // namespace

std::unique_ptr<ByteStream> openFile(const std::string& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    throw InputError(path + ": no such file; check the path");
  }
  if (std::filesystem::is_directory(status)) {
    throw InputError(path + ": is a folder; name a file in it");
  }
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) throw InputError(path + ": cannot be read: " + error.message());
  if (size == 0) throw InputError(path + ": the file is empty; copy or download it again");

  std::FILE* file = std::fopen(path.c_str(), "rb");
  if (file == nullptr) throw InputError(path + ": cannot be opened: " + std::strerror(errno));
  char magic[3] = {};
  const std::size_t n = std::fread(magic, 1, sizeof magic, file);
  std::fclose(file);
  if (n == sizeof magic && std::memcmp(magic, "BZh", sizeof magic) == 0) {
    return std::make_unique<Bz2Stream>(path, size);
  }
  auto stream = std::make_unique<GzStream>(path, size);
  const std::size_t inside = stream->read(magic, 2);
  stream->rewind();
  if (inside == 2 && std::memcmp(magic, "\x1f\x8b", 2) == 0) {
    return std::make_unique<NestedGzStream>(std::move(stream));
  }
  return stream;
}

std::unique_ptr<ByteStream> openMemory(std::string text, std::string name) {
  return std::make_unique<MemoryStream>(std::move(text), std::move(name));
}

LineReader::LineReader(std::unique_ptr<ByteStream> stream) : stream_(std::move(stream)) {}

bool LineReader::next(std::string_view& line) {
  std::size_t scanned = begin_;
  for (;;) {
    const std::size_t end = buffer_.find('\n', scanned);
    if (end != std::string::npos || (at_end_ && begin_ < buffer_.size())) {
      const std::size_t stop = end != std::string::npos ? end : buffer_.size();
      line = std::string_view(buffer_).substr(begin_, stop - begin_);
      if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
      begin_ = std::min(stop + 1, buffer_.size());
      ++line_number_;
      return true;
    }
    if (at_end_) return false;
    if (buffer_.size() - begin_ > kMaxLineBytes) {
      throw InputError(
          name() + ":" + std::to_string(line_number_ + 1) +
          ": line longer than 1 MB; this is not a text recording");
    }
    buffer_.erase(0, begin_);
    begin_ = 0;
    scanned = buffer_.size();
    buffer_.resize(scanned + kChunkBytes);
    const std::size_t n = stream_->read(buffer_.data() + scanned, kChunkBytes);
    buffer_.resize(scanned + n);
    at_end_ = n == 0;
  }
}

std::string LineReader::where() const { return name() + ":" + std::to_string(line_number_); }

void LineReader::rewind() {
  stream_->rewind();
  buffer_.clear();
  begin_ = 0;
  at_end_ = false;
  line_number_ = 0;
}

void Notes::add(const std::string& text, std::size_t number) {
  auto& entry = counts_.try_emplace(text, 0, number).first->second;
  ++entry.first;
}

std::vector<std::string> Notes::texts(const std::string& unit) const {
  std::vector<std::string> texts;
  for (const auto& [text, entry] : counts_) {
    texts.push_back(
        text + ": " + std::to_string(entry.first) + " (first at " + unit + " " +
        std::to_string(entry.second) + ")");
  }
  return texts;
}

void splitWords(std::string_view line, std::vector<std::string_view>& words) {
  words.clear();
  std::size_t i = 0;
  while (i < line.size()) {
    while (i < line.size() && (line[i] == ' ' || line[i] == '\t')) ++i;
    const std::size_t start = i;
    while (i < line.size() && line[i] != ' ' && line[i] != '\t') ++i;
    if (i > start) words.push_back(line.substr(start, i - start));
  }
}

bool parseNumber(std::string_view word, double& value) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc() && end == word.data() + word.size();
}

bool isPlausible(Timestamp stamp) {
  constexpr std::int64_t kLimit_ns = 4'600'000'000'000'000'000;
  return stamp.ns >= -kLimit_ns && stamp.ns <= kLimit_ns;
}

std::optional<Timestamp> parseStamp(std::string_view word) {
  const auto stamp = parseSeconds(word);
  return stamp && isPlausible(*stamp) ? stamp : std::nullopt;
}

std::string quoted(std::string_view word, std::size_t max_size) {
  std::string text = "'";
  for (const char c : word.substr(0, max_size)) text += c >= ' ' && c <= '~' ? c : '?';
  return text + (word.size() > max_size ? "...'" : "'");
}

}  // namespace vestibule::io
