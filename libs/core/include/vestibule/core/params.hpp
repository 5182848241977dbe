#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "vestibule/core/frames.hpp"

namespace vestibule {

/// Allowed interval of a number. NaN never passes; infinity only where `hi` is infinite and closed.
struct Bounds {
  double lo = -std::numeric_limits<double>::max();
  double hi = std::numeric_limits<double>::max();
  bool lo_open = false;
  bool hi_open = false;
};
[[nodiscard]] constexpr Bounds anyNumber() { return {}; }
[[nodiscard]] constexpr Bounds positive() {
  return {0.0, std::numeric_limits<double>::max(), true};
}
[[nodiscard]] constexpr Bounds nonNegative() { return {0.0}; }
[[nodiscard]] constexpr Bounds within(double lo, double hi) { return {lo, hi}; }
/// Open interval, e.g. for probabilities that must not be 0 or 1.
[[nodiscard]] constexpr Bounds inside(double lo, double hi) { return {lo, hi, true, true}; }

/// Where a value stands, for messages about it that come later: "config/site.yaml:42".
struct SourceRef {
  std::string file;
  int line = 0;
  [[nodiscard]] std::string text() const { return file + ":" + std::to_string(line); }
};

/// One visitor for reading a YAML mapping into a struct and for writing it back, so that a struct
/// names its keys once:
///
///   void describe(ParamIo& io, GnssParams& p) {
///     io.optional("gate_probability", p.gate_probability, inside(0.0, 1.0));
///     io.optionalDegrees("yaw_sigma_deg", p.yaw_sigma_rad, positive());
///     io.section("lever_arm", p.lever_arm);
///   }
///
/// Reading collects every problem (unknown key with the nearest known one, wrong type, out of
/// range, missing, duplicate) with file and line; loadParams throws them all in one ConfigError.
/// A field that is absent or wrong keeps its default.
class ParamIo {
 public:
  ParamIo(const ParamIo&) = delete;
  ParamIo& operator=(const ParamIo&) = delete;
  ~ParamIo();

  // --- scalars -------------------------------------------------------------------------------
  void optional(const char* key, double& value, const Bounds& bounds = {});
  void required(const char* key, double& value, const Bounds& bounds = {});
  void optional(const char* key, int& value, const Bounds& bounds = {});
  void required(const char* key, int& value, const Bounds& bounds = {});
  void optional(const char* key, std::uint64_t& value);
  void optional(const char* key, bool& value);
  void optional(const char* key, std::string& value);
  void required(const char* key, std::string& value);
  /// Absent stays empty; written only when set.
  void optional(const char* key, std::optional<double>& value, const Bounds& bounds = {});
  void optional(const char* key, std::optional<std::string>& value);

  /// Degrees in the file, radians in the struct. `bounds` are in degrees, like the file.
  void optionalDegrees(const char* key, double& value_rad, const Bounds& bounds = {});

  /// A pose as `[x_m, y_m, yaw_deg]`.
  void optional(const char* key, Pose2& pose);
  void required(const char* key, Pose2& pose);
  /// Absent stays empty; written only when set.
  void optional(const char* key, std::optional<Pose2>& pose);

  /// A list of numbers, e.g. `origin: [x, y, yaw]`; its length must lie in [min_size, max_size].
  void optional(
      const char* key,
      std::vector<double>& values,
      std::size_t min_size,
      std::size_t max_size,
      const Bounds& bounds = {});
  void required(
      const char* key,
      std::vector<double>& values,
      std::size_t min_size,
      std::size_t max_size,
      const Bounds& bounds = {});
  /// A list of lists of numbers, e.g. polygon corners; every row has `columns` numbers.
  void optional(const char* key, std::vector<std::vector<double>>& rows, std::size_t columns);
  void optional(const char* key, std::vector<std::string>& values);

  /// One word out of a fixed set, e.g. {{"mrpt", Engine::kMrpt}, {"fixed", Engine::kFixed}}.
  template <class Enum>
  void optional(
      const char* key, Enum& value, const std::vector<std::pair<std::string_view, Enum>>& names) {
    std::vector<std::string_view> words;
    std::size_t index = names.size();
    for (std::size_t i = 0; i < names.size(); ++i) {
      words.push_back(names[i].first);
      if (names[i].second == value) index = i;
    }
    choice(key, words, index);
    if (index < names.size()) value = names[index].second;
  }

  // --- structure -----------------------------------------------------------------------------
  /// A nested mapping, described by describe(ParamIo&, T&). Absent keeps all defaults.
  template <class T>
  void section(const char* key, T& value) {
    if (!enter(key, false)) return;
    describe(*this, value);
    leave();
  }
  template <class T>
  void requiredSection(const char* key, T& value) {
    if (!enter(key, true)) return;
    describe(*this, value);
    leave();
  }
  /// Absent stays empty.
  template <class T>
  void section(const char* key, std::optional<T>& value) {
    if (writing()) {
      if (value) section(key, *value);
    } else if (has(key)) {
      value.emplace();
      section(key, *value);
    }
  }
  /// A list of mappings (or of whatever describe() reads from the element itself).
  template <class T>
  void list(const char* key, std::vector<T>& values, bool is_required = false) {
    const std::size_t n = enterList(key, values.size(), is_required);
    if (!writing() && n > 0) values.assign(n, T{});
    for (std::size_t i = 0; i < n; ++i) {
      if (!enterElement(i)) continue;
      describe(*this, values[i]);
      leave();
    }
    leaveList();
  }
  /// A mapping of free names to mappings, in the order of the file: `waypoints: {door: ..., ...}`.
  template <class T>
  void table(
      const char* key, std::vector<std::pair<std::string, T>>& entries, bool is_required = false) {
    std::vector<std::string> names;
    for (const auto& entry : entries) names.push_back(entry.first);
    enterTable(key, names, is_required);
    if (!writing() && !names.empty()) entries.assign(names.size(), {});
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (!enterEntry(names[i])) continue;
      entries[i].first = names[i];
      describe(*this, entries[i].second);
      leave();
    }
    leaveTable();
  }

  // --- for describe() functions that look before they read -------------------------------------
  [[nodiscard]] bool writing() const;
  [[nodiscard]] bool has(std::string_view key) const;
  /// True if the current node is a list, for values that may be `[lat, lon, alt, yaw]` or a
  /// mapping.
  [[nodiscard]] bool isSequence() const;
  /// The current node itself as a list of numbers.
  void elements(std::vector<double>& values, std::size_t min_size, std::size_t max_size);
  /// File and line of the current node (of `key` in it where given and present).
  [[nodiscard]] SourceRef here(std::string_view key = {}) const;
  /// Keys of this mapping that nobody has asked for so far, for files that other programs write
  /// into, too: they are no problem then. What looks like a misspelt known key is not among them.
  [[nodiscard]] std::vector<std::string> takeForeignKeys();
  /// Records a problem found by the caller, e.g. one that involves two fields.
  void problem(std::string_view key, const std::string& text);

 private:
  friend class ParamFile;
  struct Impl;
  explicit ParamIo(std::unique_ptr<Impl> impl);

  bool enter(const char* key, bool is_required);
  void leave();
  void pose(const char* key, Pose2& pose, bool is_required);
  std::size_t enterList(const char* key, std::size_t size, bool is_required);
  bool enterElement(std::size_t index);
  void leaveList();
  void enterTable(const char* key, std::vector<std::string>& names, bool is_required);
  bool enterEntry(const std::string& name);
  void leaveTable();
  void choice(const char* key, const std::vector<std::string_view>& words, std::size_t& index);

  std::unique_ptr<Impl> impl_;
};

/// A YAML text being read or written; behind loadParams and dumpParams.
class ParamFile {
 public:
  /// Throws ConfigError when the file is missing or is not YAML.
  static ParamFile fromFile(const std::string& path);
  static ParamFile fromText(const std::string& yaml, const std::string& name);
  static ParamFile forWriting();

  ParamFile(ParamFile&&) noexcept;
  ~ParamFile();
  [[nodiscard]] ParamIo& io() { return *io_; }
  /// Throws ConfigError with one line per problem, in file order; call after describe().
  void finishReading();
  [[nodiscard]] std::string yaml() const;

 private:
  explicit ParamFile(std::unique_ptr<ParamIo> io);
  std::unique_ptr<ParamIo> io_;
};

template <class T>
[[nodiscard]] T loadParams(const std::string& path) {
  ParamFile file = ParamFile::fromFile(path);
  T value;
  describe(file.io(), value);
  file.finishReading();
  return value;
}

/// \param name stands for the file in messages
template <class T>
[[nodiscard]] T parseParams(const std::string& yaml, const std::string& name) {
  ParamFile file = ParamFile::fromText(yaml, name);
  T value;
  describe(file.io(), value);
  file.finishReading();
  return value;
}

/// The struct as YAML, every field with its present value.
template <class T>
[[nodiscard]] std::string dumpParams(const T& value) {
  ParamFile file = ParamFile::forWriting();
  T copy = value;
  describe(file.io(), copy);
  return file.yaml();
}

/// The known word nearest to `word` by edit distance, if near enough to be a typing error.
[[nodiscard]] std::optional<std::string> nearestWord(
    std::string_view word, const std::vector<std::string>& known);

}  // namespace vestibule
