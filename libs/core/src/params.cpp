#include "vestibule/core/params.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <sstream>
#include <tuple>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule {
namespace {

/// Shortest decimal text that reads back as the same double.
std::string numberText(double value) {
  char buffer[40];
  for (int digits = 6; digits <= 17; ++digits) {
    std::snprintf(buffer, sizeof buffer, "%.*g", digits, value);
    if (std::strtod(buffer, nullptr) == value) break;
  }
  return buffer;
}

std::string boundsText(const Bounds& b) {
  constexpr double kMax = std::numeric_limits<double>::max();
  const bool has_lo = b.lo > -kMax;
  const bool has_hi = b.hi < kMax;
  if (has_lo && has_hi) {
    return std::string("must be in ") + (b.lo_open ? "(" : "[") + numberText(b.lo) + ", " +
           numberText(b.hi) + (b.hi_open ? ")" : "]");
  }
  if (has_lo) return (b.lo_open ? "must be > " : "must be >= ") + numberText(b.lo);
  if (has_hi) return (b.hi_open ? "must be < " : "must be <= ") + numberText(b.hi);
  return "must be finite";
}

bool inBounds(double value, const Bounds& b) {
  if (std::isnan(value)) return false;
  if (b.lo_open ? value <= b.lo : value < b.lo) return false;
  return !(b.hi_open ? value >= b.hi : value > b.hi);
}

std::size_t editDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

int lineOf(const YAML::Node& node) { return node.Mark().is_null() ? 0 : node.Mark().line + 1; }

std::string describeNode(const YAML::Node& node) {
  switch (node.Type()) {
    case YAML::NodeType::Null:
      return "nothing";
    case YAML::NodeType::Scalar:
      return "'" + node.Scalar() + "'";
    case YAML::NodeType::Sequence:
      return "a list";
    case YAML::NodeType::Map:
      return "a mapping";
    case YAML::NodeType::Undefined:
      break;
  }
  return "nothing";
}

struct Problem {
  int line;
  std::string key;
  std::string text;
};

/// Nine digits hide the rounding of the conversion: 10 deg is written as 10, not
/// 10.000000000000002.
double writtenDegrees(double value_rad) { return std::round(radToDeg(value_rad) * 1e9) / 1e9; }

}  // namespace

std::optional<std::string> nearestWord(
    std::string_view word, const std::vector<std::string>& known) {
  std::optional<std::string> best;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string& candidate : known) {
    const std::size_t d = editDistance(word, candidate);
    if (d < best_distance) {
      best_distance = d;
      best = candidate;
    }
  }
  return best;
}

struct ParamIo::Impl {
  // A mapping, list element or table that describe() is inside of.
  struct Frame {
    YAML::Node node;
    std::string path;                // "ekf.gnss"
    std::vector<std::string> known;  // keys asked for, to find the unknown ones on leaving
    bool check_keys = true;
    bool read_as_elements = false;
  };

  bool writing = false;
  std::string file;
  std::vector<Frame> stack;
  std::vector<Problem> problems;
  // A list or table element sits behind its container here while it is visited.
  std::vector<YAML::Node> containers;
  std::vector<std::string> container_paths;
  YAML::Emitter out;

  [[nodiscard]] std::string pathOf(std::string_view key) const {
    const std::string& prefix = stack.back().path;
    return prefix.empty() ? std::string(key) : prefix + "." + std::string(key);
  }

  void add(int line, std::string key, std::string text) {
    problems.push_back({line, std::move(key), std::move(text)});
  }

  /// The value of `key` in the current mapping; an undefined node if absent.
  YAML::Node find(std::string_view key) const {
    const YAML::Node& node = stack.back().node;
    if (!node.IsMap()) return YAML::Node(YAML::NodeType::Undefined);
    for (const auto& entry : node) {
      if (entry.first.IsScalar() && entry.first.Scalar() == key) return entry.second;
    }
    return YAML::Node(YAML::NodeType::Undefined);
  }

  /// Marks the key as known, and gives its node if it is present and not null.
  std::optional<YAML::Node> take(const char* key, bool is_required) {
    stack.back().known.emplace_back(key);
    const YAML::Node node = find(key);
    if (node.IsDefined() && !node.IsNull()) return node;
    if (is_required) add(lineOf(stack.back().node), pathOf(key), "missing (required)");
    return std::nullopt;
  }

  std::optional<double> number(const YAML::Node& node, const std::string& path) {
    if (node.IsScalar()) {
      const std::string& text = node.Scalar();
      char* end = nullptr;
      const double value = std::strtod(text.c_str(), &end);
      // Quoted scalars carry the tag "!" and are text, whatever is between the quotes.
      if (!text.empty() && end == text.c_str() + text.size() && node.Tag() != "!") return value;
      if (text == ".inf" || text == "inf") return std::numeric_limits<double>::infinity();
    }
    add(lineOf(node), path, "must be a number, is " + describeNode(node));
    return std::nullopt;
  }

  void readNumber(
      const YAML::Node& node, const std::string& path, double& value, const Bounds& bounds) {
    const std::optional<double> v = number(node, path);
    if (!v) return;
    if (inBounds(*v, bounds)) {
      value = *v;
    } else {
      add(lineOf(node), path + " = " + node.Scalar(), boundsText(bounds));
    }
  }

  void readInteger(
      const YAML::Node& node, const std::string& path, int& value, const Bounds& bounds) {
    const std::optional<double> v = number(node, path);
    if (!v) return;
    if (*v != std::floor(*v) || std::abs(*v) > 2147483647.0) {
      add(lineOf(node), path + " = " + node.Scalar(), "must be a whole number");
    } else if (!inBounds(*v, bounds)) {
      add(lineOf(node), path + " = " + node.Scalar(), boundsText(bounds));
    } else {
      value = static_cast<int>(*v);
    }
  }

  void readText(const YAML::Node& node, const std::string& path, std::string& value) {
    if (node.IsScalar()) {
      value = node.Scalar();
    } else {
      add(lineOf(node), path, "must be text, is " + describeNode(node));
    }
  }

  void readNumbers(
      const YAML::Node& node,
      const std::string& path,
      std::vector<double>& values,
      std::size_t min_size,
      std::size_t max_size,
      const Bounds& bounds) {
    if (!node.IsSequence()) {
      add(lineOf(node), path, "must be a list of numbers, is " + describeNode(node));
      return;
    }
    if (node.size() < min_size || node.size() > max_size) {
      std::string count = std::to_string(min_size);
      if (max_size != min_size) {
        count += max_size == std::numeric_limits<std::size_t>::max()
                     ? " or more"
                     : " to " + std::to_string(max_size);
      }
      add(lineOf(node),
          path,
          "must have " + count + " numbers, has " + std::to_string(node.size()));
      return;
    }
    const std::size_t before = problems.size();
    std::vector<double> read(node.size());
    for (std::size_t i = 0; i < node.size(); ++i) {
      readNumber(node[i], path + "[" + std::to_string(i) + "]", read[i], bounds);
    }
    if (problems.size() == before) values = std::move(read);
  }

  void push(const YAML::Node& node, std::string path) {
    if (!node.IsMap() && !node.IsSequence()) {
      add(lineOf(node), path, "must be a mapping, is " + describeNode(node));
    }
    stack.push_back({node, std::move(path), {}, true, false});
  }

  void checkKeys(const Frame& frame) {
    if (frame.read_as_elements) return;
    if (frame.node.IsSequence()) {
      add(lineOf(frame.node), frame.path, "must be a mapping, is a list");
      return;
    }
    if (!frame.check_keys || !frame.node.IsMap()) return;
    std::vector<std::string> seen;
    for (const auto& entry : frame.node) {
      const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "(not a word)";
      const std::string path = frame.path.empty() ? key : frame.path + "." + key;
      if (std::find(seen.begin(), seen.end(), key) != seen.end()) {
        add(lineOf(entry.first), path, "given twice");
        continue;
      }
      seen.push_back(key);
      if (std::find(frame.known.begin(), frame.known.end(), key) != frame.known.end()) continue;
      const auto near = nearestWord(key, frame.known);
      add(lineOf(entry.first),
          path,
          near ? "unknown key (did you mean " + *near + "?)" : "unknown key");
    }
  }

  void emitKey(std::string_view key) { out << YAML::Key << std::string(key) << YAML::Value; }
  void emitNumbers(const std::vector<double>& values) {
    out << YAML::Flow << YAML::BeginSeq;
    for (const double v : values) out << numberText(v);
    out << YAML::EndSeq;
  }
};

ParamIo::ParamIo(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ParamIo::~ParamIo() = default;

// --- scalars ---------------------------------------------------------------------------------

void ParamIo::optional(const char* key, double& value, const Bounds& bounds) {
  if (impl_->writing) {
    impl_->emitKey(key);
    impl_->out << numberText(value);
  } else if (const auto node = impl_->take(key, false)) {
    impl_->readNumber(*node, impl_->pathOf(key), value, bounds);
  }
}

void ParamIo::required(const char* key, double& value, const Bounds& bounds) {
  if (impl_->writing) {
    optional(key, value, bounds);
  } else if (const auto node = impl_->take(key, true)) {
    impl_->readNumber(*node, impl_->pathOf(key), value, bounds);
  }
}

void ParamIo::optional(const char* key, int& value, const Bounds& bounds) {
  if (impl_->writing) {
    impl_->emitKey(key);
    impl_->out << value;
  } else if (const auto node = impl_->take(key, false)) {
    impl_->readInteger(*node, impl_->pathOf(key), value, bounds);
  }
}

void ParamIo::required(const char* key, int& value, const Bounds& bounds) {
  if (impl_->writing) {
    optional(key, value, bounds);
  } else if (const auto node = impl_->take(key, true)) {
    impl_->readInteger(*node, impl_->pathOf(key), value, bounds);
  }
}

void ParamIo::optional(const char* key, std::uint64_t& value) {
  if (impl_->writing) {
    impl_->emitKey(key);
    impl_->out << value;
  } else if (const auto node = impl_->take(key, false)) {
    try {
      if (node->Scalar().find('-') != std::string::npos) throw YAML::BadConversion(node->Mark());
      value = node->as<std::uint64_t>();
    } catch (const YAML::Exception&) {
      impl_->add(
          lineOf(*node),
          impl_->pathOf(key),
          "must be a whole number >= 0, is " + describeNode(*node));
    }
  }
}

void ParamIo::optional(const char* key, bool& value) {
  if (impl_->writing) {
    impl_->emitKey(key);
    impl_->out << value;
  } else if (const auto node = impl_->take(key, false)) {
    try {
      value = node->as<bool>();
    } catch (const YAML::Exception&) {
      impl_->add(
          lineOf(*node), impl_->pathOf(key), "must be true or false, is " + describeNode(*node));
    }
  }
}

void ParamIo::optional(const char* key, std::string& value) {
  if (impl_->writing) {
    impl_->emitKey(key);
    impl_->out << YAML::DoubleQuoted << value;
  } else if (const auto node = impl_->take(key, false)) {
    impl_->readText(*node, impl_->pathOf(key), value);
  }
}

void ParamIo::required(const char* key, std::string& value) {
  if (impl_->writing) {
    optional(key, value);
  } else if (const auto node = impl_->take(key, true)) {
    impl_->readText(*node, impl_->pathOf(key), value);
  }
}

void ParamIo::optional(const char* key, std::optional<double>& value, const Bounds& bounds) {
  if (impl_->writing) {
    if (value) optional(key, *value, bounds);
  } else if (const auto node = impl_->take(key, false)) {
    double read = 0.0;
    const std::size_t before = impl_->problems.size();
    impl_->readNumber(*node, impl_->pathOf(key), read, bounds);
    if (impl_->problems.size() == before) value = read;
  }
}

void ParamIo::optional(const char* key, std::optional<std::string>& value) {
  if (impl_->writing) {
    if (value) optional(key, *value);
  } else if (const auto node = impl_->take(key, false)) {
    value.emplace();
    impl_->readText(*node, impl_->pathOf(key), *value);
  }
}

void ParamIo::optionalDegrees(const char* key, double& value_rad, const Bounds& bounds) {
  double value_deg = impl_->writing ? writtenDegrees(value_rad) : radToDeg(value_rad);
  const double before = value_deg;
  optional(key, value_deg, bounds);
  if (!impl_->writing && value_deg != before) value_rad = degToRad(value_deg);
}

void ParamIo::pose(const char* key, Pose2& pose, bool is_required) {
  const double yaw_deg = impl_->writing ? writtenDegrees(pose.phi) : radToDeg(pose.phi);
  std::vector<double> values{pose.x, pose.y, yaw_deg};
  if (is_required) {
    required(key, values, 3, 3);
  } else {
    optional(key, values, 3, 3);
  }
  if (impl_->writing) return;
  pose.x = values[0];
  pose.y = values[1];
  if (values[2] != yaw_deg) pose.phi = wrapToPi(degToRad(values[2]));
}

void ParamIo::optional(const char* key, Pose2& value) { pose(key, value, false); }

void ParamIo::required(const char* key, Pose2& value) { pose(key, value, true); }

void ParamIo::optional(const char* key, std::optional<Pose2>& value) {
  if (impl_->writing ? !value.has_value() : !has(key)) return;
  Pose2 read = value.value_or(Pose2{});
  pose(key, read, true);
  value = read;
}

void ParamIo::optional(
    const char* key,
    std::vector<double>& values,
    std::size_t min_size,
    std::size_t max_size,
    const Bounds& bounds) {
  if (impl_->writing) {
    impl_->emitKey(key);
    impl_->emitNumbers(values);
  } else if (const auto node = impl_->take(key, false)) {
    impl_->readNumbers(*node, impl_->pathOf(key), values, min_size, max_size, bounds);
  }
}

void ParamIo::required(
    const char* key,
    std::vector<double>& values,
    std::size_t min_size,
    std::size_t max_size,
    const Bounds& bounds) {
  if (impl_->writing) {
    optional(key, values, min_size, max_size, bounds);
  } else if (const auto node = impl_->take(key, true)) {
    impl_->readNumbers(*node, impl_->pathOf(key), values, min_size, max_size, bounds);
  }
}

void ParamIo::optional(
    const char* key, std::vector<std::vector<double>>& rows, std::size_t columns) {
  if (impl_->writing) {
    impl_->emitKey(key);
    impl_->out << YAML::BeginSeq;
    for (const auto& row : rows) impl_->emitNumbers(row);
    impl_->out << YAML::EndSeq;
    return;
  }
  const auto node = impl_->take(key, false);
  if (!node) return;
  const std::string path = impl_->pathOf(key);
  if (!node->IsSequence()) {
    impl_->add(lineOf(*node), path, "must be a list of lists, is " + describeNode(*node));
    return;
  }
  rows.assign(node->size(), std::vector<double>(columns, 0.0));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    impl_->readNumbers(
        (*node)[i], path + "[" + std::to_string(i) + "]", rows[i], columns, columns, {});
  }
}

void ParamIo::optional(const char* key, std::vector<std::string>& values) {
  if (impl_->writing) {
    impl_->emitKey(key);
    impl_->out << YAML::Flow << YAML::BeginSeq;
    for (const auto& value : values) impl_->out << YAML::DoubleQuoted << value;
    impl_->out << YAML::EndSeq;
    return;
  }
  const auto node = impl_->take(key, false);
  if (!node) return;
  const std::string path = impl_->pathOf(key);
  if (!node->IsSequence()) {
    impl_->add(lineOf(*node), path, "must be a list, is " + describeNode(*node));
    return;
  }
  values.assign(node->size(), {});
  for (std::size_t i = 0; i < values.size(); ++i) {
    impl_->readText((*node)[i], path + "[" + std::to_string(i) + "]", values[i]);
  }
}

void ParamIo::choice(
    const char* key, const std::vector<std::string_view>& words, std::size_t& index) {
  if (impl_->writing) {
    impl_->emitKey(key);
    impl_->out << std::string(index < words.size() ? words[index] : "?");
    return;
  }
  const auto node = impl_->take(key, false);
  if (!node) return;
  if (node->IsScalar()) {
    const auto it = std::find(words.begin(), words.end(), std::string_view(node->Scalar()));
    if (it != words.end()) {
      index = static_cast<std::size_t>(it - words.begin());
      return;
    }
  }
  std::string all;
  for (const auto word : words) all += (all.empty() ? "" : ", ") + std::string(word);
  impl_->add(
      lineOf(*node), impl_->pathOf(key), "must be one of " + all + ", is " + describeNode(*node));
}

// --- structure ---------------------------------------------------------------------------------

bool ParamIo::enter(const char* key, bool is_required) {
  if (impl_->writing) {
    impl_->emitKey(key);
    impl_->out << YAML::BeginMap;
    return true;
  }
  const auto node = impl_->take(key, is_required);
  if (!node) return false;
  impl_->push(*node, impl_->pathOf(key));
  return true;
}

void ParamIo::leave() {
  if (impl_->writing) {
    impl_->out << YAML::EndMap;
    return;
  }
  impl_->checkKeys(impl_->stack.back());
  impl_->stack.pop_back();
}

std::size_t ParamIo::enterList(const char* key, std::size_t size, bool is_required) {
  if (impl_->writing) {
    impl_->emitKey(key);
    impl_->out << YAML::BeginSeq;
    return size;
  }
  const auto node = impl_->take(key, is_required);
  impl_->containers.push_back(node.value_or(YAML::Node(YAML::NodeType::Sequence)));
  impl_->container_paths.push_back(impl_->pathOf(key));
  if (!node) return 0;
  if (!node->IsSequence()) {
    impl_->add(lineOf(*node), impl_->pathOf(key), "must be a list, is " + describeNode(*node));
    return 0;
  }
  return node->size();
}

bool ParamIo::enterElement(std::size_t index) {
  if (impl_->writing) {
    impl_->out << YAML::BeginMap;
    return true;
  }
  impl_->push(
      impl_->containers.back()[index],
      impl_->container_paths.back() + "[" + std::to_string(index) + "]");
  return true;
}

void ParamIo::leaveList() {
  if (impl_->writing) {
    impl_->out << YAML::EndSeq;
    return;
  }
  impl_->containers.pop_back();
  impl_->container_paths.pop_back();
}

void ParamIo::enterTable(const char* key, std::vector<std::string>& names, bool is_required) {
  if (impl_->writing) {
    impl_->emitKey(key);
    impl_->out << YAML::BeginMap;
    return;
  }
  names.clear();
  const auto node = impl_->take(key, is_required);
  const std::string path = impl_->pathOf(key);
  impl_->containers.push_back(node.value_or(YAML::Node(YAML::NodeType::Map)));
  impl_->container_paths.push_back(path);
  if (!node) return;
  if (!node->IsMap()) {
    impl_->add(lineOf(*node), path, "must be a mapping, is " + describeNode(*node));
    return;
  }
  for (const auto& entry : *node) {
    const std::string name = entry.first.IsScalar() ? entry.first.Scalar() : "";
    if (name.empty()) {
      impl_->add(lineOf(entry.first), path, "every entry needs a name");
    } else if (std::find(names.begin(), names.end(), name) != names.end()) {
      impl_->add(lineOf(entry.first), path + "." + name, "given twice");
    } else {
      names.push_back(name);
    }
  }
}

bool ParamIo::enterEntry(const std::string& name) {
  if (impl_->writing) {
    impl_->emitKey(name);
    impl_->out << YAML::BeginMap;
    return true;
  }
  for (const auto& entry : impl_->containers.back()) {
    if (entry.first.IsScalar() && entry.first.Scalar() == name) {
      impl_->push(entry.second, impl_->container_paths.back() + "." + name);
      return true;
    }
  }
  return false;
}

void ParamIo::leaveTable() {
  if (impl_->writing) {
    impl_->out << YAML::EndMap;
    return;
  }
  impl_->containers.pop_back();
  impl_->container_paths.pop_back();
}

bool ParamIo::writing() const { return impl_->writing; }

bool ParamIo::has(std::string_view key) const {
  if (impl_->writing) return false;
  const YAML::Node node = impl_->find(key);
  return node.IsDefined() && !node.IsNull();
}

bool ParamIo::isSequence() const {
  return !impl_->writing && impl_->stack.back().node.IsSequence();
}

void ParamIo::elements(std::vector<double>& values, std::size_t min_size, std::size_t max_size) {
  auto& frame = impl_->stack.back();
  frame.read_as_elements = true;
  impl_->readNumbers(frame.node, frame.path, values, min_size, max_size, {});
}

SourceRef ParamIo::here(std::string_view key) const {
  if (impl_->writing) return {};
  if (!key.empty()) {
    const YAML::Node node = impl_->find(key);
    if (node.IsDefined()) return {impl_->file, lineOf(node)};
  }
  return {impl_->file, lineOf(impl_->stack.back().node)};
}

std::vector<std::string> ParamIo::takeForeignKeys() {
  std::vector<std::string> foreign;
  if (impl_->writing || !impl_->stack.back().node.IsMap()) return foreign;
  std::vector<std::string>& known = impl_->stack.back().known;
  for (const auto& entry : impl_->stack.back().node) {
    if (!entry.first.IsScalar()) continue;
    const std::string& key = entry.first.Scalar();
    if (std::find(known.begin(), known.end(), key) == known.end() && !nearestWord(key, known)) {
      foreign.push_back(key);
    }
  }
  known.insert(known.end(), foreign.begin(), foreign.end());
  return foreign;
}

void ParamIo::problem(std::string_view key, const std::string& text) {
  if (impl_->writing) return;
  impl_->add(here(key).line, key.empty() ? impl_->stack.back().path : impl_->pathOf(key), text);
}

// --- files ---------------------------------------------------------------------------------------

ParamFile::ParamFile(std::unique_ptr<ParamIo> io) : io_(std::move(io)) {}
ParamFile::ParamFile(ParamFile&&) noexcept = default;
ParamFile::~ParamFile() = default;

ParamFile ParamFile::fromText(const std::string& yaml, const std::string& name) {
  auto impl = std::make_unique<ParamIo::Impl>();
  impl->file = name;
  YAML::Node root;
  try {
    root = YAML::Load(yaml);
  } catch (const YAML::Exception& e) {
    throw ConfigError(
        name + ":" + std::to_string(e.mark.is_null() ? 1 : e.mark.line + 1) +
        ": not valid YAML: " + e.msg);
  }
  if (root.IsNull()) root = YAML::Node(YAML::NodeType::Map);
  if (!root.IsMap()) throw ConfigError(name + ":1: must be a mapping of keys to values");
  impl->push(root, "");
  return ParamFile(std::unique_ptr<ParamIo>(new ParamIo(std::move(impl))));
}

ParamFile ParamFile::fromFile(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  if (!in || !(text << in.rdbuf())) {
    throw ConfigError(path + ": cannot be read (missing, empty, or no permission)");
  }
  return fromText(text.str(), path);
}

ParamFile ParamFile::forWriting() {
  auto impl = std::make_unique<ParamIo::Impl>();
  impl->writing = true;
  impl->out << YAML::BeginMap;
  return ParamFile(std::unique_ptr<ParamIo>(new ParamIo(std::move(impl))));
}

void ParamFile::finishReading() {
  ParamIo::Impl& impl = *io_->impl_;
  impl.checkKeys(impl.stack.back());
  if (impl.problems.empty()) return;
  std::stable_sort(
      impl.problems.begin(), impl.problems.end(), [](const Problem& a, const Problem& b) {
        return a.line < b.line;
      });
  std::string text;
  for (const Problem& p : impl.problems) {
    if (!text.empty()) text += '\n';
    text += impl.file + ":" + std::to_string(std::max(1, p.line)) + ": ";
    if (!p.key.empty()) text += p.key + ": ";
    text += p.text;
  }
  throw ConfigError(text);
}

std::string ParamFile::yaml() const {
  ParamIo::Impl& impl = *io_->impl_;
  impl.out << YAML::EndMap;
  return std::string(impl.out.c_str()) + "\n";
}

}  // namespace vestibule
