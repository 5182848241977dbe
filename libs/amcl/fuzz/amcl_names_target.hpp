#pragma once

#include <string>

namespace vestibule::amcl::fuzz {

/// Reads the bytes as a file of AMCL's parameters. A ConfigError is a good outcome; any other
/// exception leaves.
void readAmclNames(const std::string& bytes);

}  // namespace vestibule::amcl::fuzz
