#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "child_process.hpp"
#include "test_files.hpp"

namespace vestibule::test {

/// A test of the built program: a folder of its own, and ways to run the program there.
class Cli : public testing::Test {
 protected:
  /// The program with these arguments, to its end.
  [[nodiscard]] CommandResult run(const std::vector<std::string>& arguments) const;
  [[nodiscard]] static std::vector<std::string> commandLine(
      const std::vector<std::string>& arguments);

  /// Writes a file into the test's folder and gives its path.
  std::string file(const std::string& name, const std::string& bytes) const {
    return writeFile(folder_.path() / name, bytes);
  }
  [[nodiscard]] std::string path(const std::string& name) const { return folder_ / name; }

  /// A small map_server map: a room of 4 x 4 m.
  [[nodiscard]] std::string roomMap() const;
  /// A mission of half a minute on the shipped farm: from the apron through the west door.
  [[nodiscard]] std::string shortMission() const;
  /// A mission on the shipped farm with this one waypoint, e.g. "{x: 1, y: 2}", in line 7.
  [[nodiscard]] std::string missionTo(const std::string& waypoint) const;

  /// Nothing under a final name in the output folder `out` of this test.
  void expectNoOutput(const std::string& out) const;

  TempFolder folder_;
};

inline const char* const kFarmWorld = "config/worlds/farm.yaml";
inline const char* const kMrptDatasets = "/usr/share/mrpt/datasets/";

}  // namespace vestibule::test
