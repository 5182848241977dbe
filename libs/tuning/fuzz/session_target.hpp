#pragma once

#include <string>

namespace vestibule::tuning::fuzz {

/// Reads the bytes as a session. A complaint (ConfigError) is a good outcome; any other exception
/// leaves.
void readSession(const std::string& bytes);
/// The same as a suite of benchmarks.
void readSuite(const std::string& bytes);

}  // namespace vestibule::tuning::fuzz
