#include "amcl_file.hpp"

#include <tinyxml2.h>

#include <fstream>
#include <iterator>
#include <map>

#include "vestibule/core/errors.hpp"

namespace vestibule::amcl {
namespace {

std::string at(const std::string& path, int line) {
  return path + ":" + std::to_string(line) + ": ";
}

constexpr int kDeepest = 8;

// --- YAML ----------------------------------------------------------------------------------------

/// What stands under `key`, here or one level down (a namespace).
YAML::Node below(const YAML::Node& node, const std::string& key) {
  if (!node.IsMap()) return YAML::Node(YAML::NodeType::Undefined);
  if (node[key]) return node[key];
  for (const auto& entry : node) {
    if (entry.second.IsMap() && entry.second[key]) return entry.second[key];
  }
  return YAML::Node(YAML::NodeType::Undefined);
}

void collect(
    const std::string& path,
    const std::string& prefix,
    const YAML::Node& node,
    int depth,
    std::vector<AmclEntry>& entries) {
  for (const auto& entry : node) {
    const std::string where = at(path, entry.first.Mark().line + 1);
    // An alias may stand within what it names.
    if (depth > kDeepest) throw ConfigError(where + "nested too deeply");
    if (!entry.first.IsScalar()) throw ConfigError(where + "a name must be a word");
    const std::string name = prefix + entry.first.Scalar();
    if (entry.second.IsMap()) {
      collect(path, name + ".", entry.second, depth + 1, entries);
    } else {
      entries.push_back({name, entry.second, where});
    }
  }
}

std::vector<AmclEntry> fromYaml(const std::string& path, const std::string& text) {
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::Exception& e) {
    throw ConfigError(at(path, e.mark.line + 1) + e.msg);
  }
  YAML::Node parameters = root;
  for (const char* key : {"amcl", "ros__parameters"}) {
    const YAML::Node found = below(parameters, key);
    if (found.IsDefined()) parameters.reset(found);
  }
  if (!parameters.IsMap()) {
    throw ConfigError(path + ": no parameters in it; expected `amcl: ros__parameters:` or names");
  }
  std::vector<AmclEntry> entries;
  collect(path, "", parameters, 0, entries);
  return entries;
}

// --- ROS 1 launch --------------------------------------------------------------------------------

using tinyxml2::XMLElement;

std::string attribute(const XMLElement& element, const char* name) {
  const char* value = element.Attribute(name);
  return value == nullptr ? std::string() : value;
}

/// `$(arg NAME)` replaced by what the file itself says about it.
std::string filledIn(
    std::string text, const std::map<std::string, std::string>& args, const std::string& where) {
  for (std::size_t begin = text.find("$("); begin != std::string::npos; begin = text.find("$(")) {
    const std::size_t end = text.find(')', begin);
    const std::string inner = text.substr(begin + 2, end - begin - 2);
    const std::string name = inner.substr(0, 4) == "arg " ? inner.substr(4) : std::string();
    const auto arg = args.find(name);
    if (end == std::string::npos || arg == args.end()) {
      throw ConfigError(where + text + ": only arguments with a value in this file are filled in");
    }
    text.replace(begin, end + 1 - begin, arg->second);
  }
  return text;
}

void collect(
    const std::string& path,
    const XMLElement& parent,
    bool of_amcl,
    std::map<std::string, std::string>& args,
    std::vector<AmclEntry>& entries) {
  for (const XMLElement* e = parent.FirstChildElement(); e != nullptr;
       e = e->NextSiblingElement()) {
    const std::string kind = e->Name();
    const std::string where = at(path, e->GetLineNum());
    const std::string name = attribute(*e, "name");
    if (kind == "arg") {
      const char* value =
          e->Attribute("value") != nullptr ? e->Attribute("value") : e->Attribute("default");
      if (value != nullptr) args[name] = filledIn(value, args, where);
    } else if (kind == "param" && of_amcl) {
      // One value that is no YAML (a text with a colon) is a word.
      const std::string value = filledIn(attribute(*e, "value"), args, where);
      YAML::Node node(value);
      try {
        node = YAML::Load(value);
      } catch (const YAML::Exception&) {
      }
      entries.push_back({name, node, where});
    } else if (kind == "rosparam" && of_amcl) {
      throw ConfigError(where + "rosparam is not read; give the file it names instead");
    } else if (kind == "group" || kind == "node") {
      collect(path, *e, kind == "node" ? attribute(*e, "pkg") == "amcl" : of_amcl, args, entries);
    }
  }
}

std::vector<AmclEntry> fromLaunch(const std::string& path, const std::string& text) {
  tinyxml2::XMLDocument document;
  if (document.Parse(text.c_str(), text.size()) != tinyxml2::XML_SUCCESS) {
    throw ConfigError(at(path, document.ErrorLineNum()) + "not a sound launch file");
  }
  std::vector<AmclEntry> entries;
  std::map<std::string, std::string> args;
  if (const XMLElement* root = document.RootElement()) collect(path, *root, false, args, entries);
  if (entries.empty()) throw ConfigError(path + ": no <node pkg=\"amcl\"> with a <param> in it");
  return entries;
}

}  // namespace

std::string readAmclFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(file), {}};
  if (!file || text.empty()) {
    throw InputError(path + ": cannot be read; give a parameter file of nav2_amcl or amcl");
  }
  return text;
}

std::vector<AmclEntry> parseAmclFile(const std::string& text, const std::string& path) {
  const std::size_t first = text.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  return first != std::string::npos && text[first] == '<' ? fromLaunch(path, text)
                                                          : fromYaml(path, text);
}

}  // namespace vestibule::amcl
