#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

namespace vestibule::amcl {

/// One parameter as it stands in a file.
struct AmclEntry {
  std::string name;
  YAML::Node value;
  std::string where;  ///< "file:line: "
};

/// The parameters of AMCL in a parameter file of nav2 (`amcl: ros__parameters:`, also below a
/// namespace), in one of ROS 1 (flat names, with or without `amcl:`) or in a ROS 1 launch file
/// (`<node pkg="amcl">` with `<param>`; its own `<arg>`s are filled in). Nested names are joined by
/// dots. Throws ConfigError where the text is something else.
/// \param path of the file, for messages
[[nodiscard]] std::vector<AmclEntry> parseAmclFile(
    const std::string& text, const std::string& path);
/// The text of such a file. Throws InputError where it cannot be read.
[[nodiscard]] std::string readAmclFile(const std::string& path);

}  // namespace vestibule::amcl
