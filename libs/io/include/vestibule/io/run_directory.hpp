#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace vestibule::io {

/// The output folder of a run. Files are written below DIR/.partial-<pid>/ and get their final name
/// only in commit(), so nothing half-written ever stands under a final name. What was not committed
/// disappears with the object, also when an exception unwinds; what a killed run left disappears
/// with the next one in the same folder.
class RunDirectory {
 public:
  /// Creates DIR where missing. Throws ConfigError naming it when it cannot be created or written.
  explicit RunDirectory(std::filesystem::path path);
  RunDirectory(const RunDirectory&) = delete;
  RunDirectory& operator=(const RunDirectory&) = delete;
  ~RunDirectory();

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

  /// Where to write the file that will be DIR/name. `name` may have folders; it stays inside DIR.
  /// Asking twice for one name gives the same path.
  [[nodiscard]] std::filesystem::path stage(const std::string& name);

  /// Renames every staged file that was written to its final name (replacing an older one), in the
  /// order of staging but summary.json last: where that file stands, the run is complete.
  /// Throws ConfigError naming the file that could not be renamed. Close the streams first.
  void commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path partial_;
  std::vector<std::string> names_;
  bool created_ = false;  ///< the folder was not there before
};

}  // namespace vestibule::io
