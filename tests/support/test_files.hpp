#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace vestibule::test {

/// A new empty folder that disappears with the object.
class TempFolder {
 public:
  TempFolder();
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;
  ~TempFolder();

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::string operator/(const std::string& name) const {
    return (path_ / name).string();
  }

 private:
  std::filesystem::path path_;
};

/// Writes the bytes (creating folders) and gives the path back. Throws when that fails.
std::string writeFile(const std::filesystem::path& path, const std::string& bytes);

/// Throws when the file cannot be read.
[[nodiscard]] std::string readFile(const std::filesystem::path& path);

/// Regular files below the folder, relative to it, sorted; empty when there is no such folder.
/// Files in `.partial-*` folders have no final name yet and are left out.
[[nodiscard]] std::vector<std::string> finalFiles(const std::filesystem::path& folder);

/// Lines of a text without their newlines.
[[nodiscard]] std::vector<std::string> lines(const std::string& text);

/// A file of the source tree, e.g. "config/worlds/farm.yaml".
[[nodiscard]] std::string shipped(const std::string& name);

}  // namespace vestibule::test
