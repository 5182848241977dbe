#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/amcl/params.hpp"
#include "vestibule/core/frames.hpp"

namespace vestibule::amcl {

/// What a parameter file of nav2_amcl, or of ROS 1's amcl, changed here.
struct AmclNames {
  std::vector<std::string> applied;  ///< names as they stand in the file
  /// Known there, without a counterpart here: why, and which.
  std::map<std::string, std::vector<std::string>> ignored;
  std::vector<std::string> unknown;      ///< not known there either
  std::optional<Pose2> T_map_base_init;  ///< initial_pose, where the file wants one set
};

/// Reads AMCL's parameters by their usual names into ours; docs/localization.md has the table. The
/// file may be nav2's (`amcl: ros__parameters: ...`), ROS 1's flat names, with or without an
/// `amcl:` above them, or a launch file of ROS 1. Throws ConfigError with file:line for values that
/// are none or that our own rules refuse, and InputError where the file cannot be read.
[[nodiscard]] AmclNames applyAmclFile(const std::string& path, AmclParams& params);
/// The same of a file's text. \param name of the file, for messages
[[nodiscard]] AmclNames applyAmclText(
    const std::string& text, const std::string& name, AmclParams& params);

}  // namespace vestibule::amcl
