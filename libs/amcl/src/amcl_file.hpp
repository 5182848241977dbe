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
/// dots. Throws InputError where the file cannot be read, ConfigError where it is something else.
[[nodiscard]] std::vector<AmclEntry> readAmclFile(const std::string& path);

}  // namespace vestibule::amcl
