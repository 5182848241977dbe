#pragma once

#include <string>

namespace vestibule::tuning::fuzz {

/// Reads the bytes as a session. A complaint (ConfigError) is a good outcome; any other exception
/// leaves.
void readSession(const std::string& bytes);

}  // namespace vestibule::tuning::fuzz
