#include "vestibule/tuning/parameter_tree.hpp"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <cstdio>

#include "vestibule/core/params.hpp"

namespace vestibule::tuning {
namespace {

void flatten(
    const YAML::Node& node,
    const std::string& path,
    std::map<std::string, double>& numbers,
    std::vector<std::string>& others) {
  if (node.IsMap()) {
    for (const auto& entry : node) {
      const auto key = entry.first.as<std::string>();
      flatten(entry.second, path.empty() ? key : path + "." + key, numbers, others);
    }
    return;
  }
  double value = 0.0;
  if (node.IsScalar() && YAML::convert<double>::decode(node, value) && std::isfinite(value)) {
    numbers.emplace(path, value);
  } else {
    others.push_back(path);
  }
}

/// The values as nested mappings.
struct Branch {
  std::vector<std::pair<std::string, Branch>> children;
  std::optional<double> value;

  Branch& child(const std::string& key) {
    for (auto& [name, branch] : children) {
      if (name == key) return branch;
    }
    return children.emplace_back(key, Branch{}).second;
  }

  void print(int depth, std::string& text) const {
    for (const auto& [name, branch] : children) {
      text += std::string(2 * static_cast<std::size_t>(depth), ' ') + name + ":";
      text += branch.value ? " " + shortNumber(*branch.value) + "\n" : "\n";
      branch.print(depth + 1, text);
    }
  }
};

}  // namespace

ParameterTree::ParameterTree(const pipeline::Config& config) {
  flatten(YAML::Load(dumpParams(config)), "", numbers_, others_);
}

std::optional<double> ParameterTree::value(const std::string& name) const {
  const auto it = numbers_.find(name);
  if (it == numbers_.end()) return std::nullopt;
  return it->second;
}

std::string ParameterTree::whyNot(const std::string& name) const {
  if (numbers_.count(name) > 0) return "";
  for (const std::string& other : others_) {
    if (other == name) return "is not a number: only numbers can be tuned";
  }
  std::vector<std::string> known;
  for (const auto& entry : numbers_) known.push_back(entry.first);
  const auto near = nearestWord(name, known);
  return "unknown parameter" +
         (near ? " (did you mean " + *near + "?)" : "; config/default.yaml lists them all");
}

pipeline::Config withValues(const pipeline::Config& config, const NamedValues& values) {
  pipeline::Config result = config;
  ParamFile file = ParamFile::fromText(asYaml(values), "tuned values");
  describe(file.io(), result);
  file.finishReading();
  return result;
}

std::string asYaml(const NamedValues& values) {
  Branch root;
  for (const auto& [name, value] : values) {
    Branch* at = &root;
    for (std::size_t from = 0; from <= name.size();) {
      const std::size_t to = std::min(name.find('.', from), name.size());
      at = &at->child(name.substr(from, to - from));
      from = to + 1;
    }
    at->value = value;
  }
  std::string text;
  root.print(0, text);
  return text;
}

std::string shortNumber(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

}  // namespace vestibule::tuning
