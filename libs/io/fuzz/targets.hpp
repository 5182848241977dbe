#pragma once

#include <string>

namespace vestibule::io::fuzz {

/// Each reads the bytes as its format to the end. A complaint (InputError, ConfigError) is a good
/// outcome; any other exception leaves.
void readCarmen(const std::string& bytes);
void readCsv(const std::string& bytes);
void readMapYaml(const std::string& bytes);
void readCdr(const std::string& bytes);  ///< as each of the messages that are read
void readPgm(const std::string& bytes);
void readWeanMapBytes(const std::string& bytes);

}  // namespace vestibule::io::fuzz
