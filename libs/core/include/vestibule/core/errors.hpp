#pragma once

#include <stdexcept>
#include <string>

namespace vestibule {

/// Broken or missing input data (recording, map image, trajectory). Exit code 3.
/// The text names file, line or record, value and remedy.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Wrong usage or configuration (arguments, parameter, site, world and mission files). Exit code 2.
/// The text may have several lines, one per problem.
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace vestibule
