#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "vestibule/core/errors.hpp"
#include "vestibule/io/recording.hpp"

namespace vestibule::io {

/// A folder of the running test's own, empty at the start.
inline std::filesystem::path testFolder() {
  const auto* info = testing::UnitTest::GetInstance()->current_test_info();
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) /
      (std::string("vestibule_io_") + info->test_suite_name() + "_" + info->name());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

inline std::string writeFile(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
  return path.string();
}

inline std::string readFile(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

/// All records of a recording.
inline std::vector<Record> readAll(const std::string& path, const RecordingOptions& options = {}) {
  const auto reader = openRecording(path, options);
  std::vector<Record> records;
  while (auto record = reader->next()) records.push_back(std::move(*record));
  return records;
}

/// What reading the recording complains about; empty if nothing.
inline std::string inputError(const std::string& path, const RecordingOptions& options = {}) {
  try {
    (void)readAll(path, options);
  } catch (const InputError& e) {
    return e.what();
  }
  return {};
}

}  // namespace vestibule::io
