#include "vestibule/io/run_directory.hpp"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <string>

#include "vestibule/core/errors.hpp"

namespace vestibule::io {

namespace fs = std::filesystem;

namespace {

const std::string kPartial = ".partial-";

/// What killed runs left behind: folders named after processes that no longer live.
void removeLeftovers(const fs::path& folder) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (name.compare(0, kPartial.size(), kPartial) != 0) continue;
    const long pid = std::strtol(name.c_str() + kPartial.size(), nullptr, 10);
    if (pid > 0 && ::kill(static_cast<pid_t>(pid), 0) != 0 && errno == ESRCH) {
      fs::remove_all(entry.path(), error);
    }
  }
}

}  // namespace

RunDirectory::RunDirectory(fs::path path)
    : path_(std::move(path)), partial_(path_ / (kPartial + std::to_string(::getpid()))) {
  std::error_code error;
  created_ = fs::create_directories(path_, error);
  removeLeftovers(path_);
  if (!error && !fs::is_directory(path_)) error = std::make_error_code(std::errc::not_a_directory);
  // A folder of this name can only be left from a killed run whose process id came round again.
  if (!error) fs::remove_all(partial_, error);
  if (!error) fs::create_directory(partial_, error);
  if (error) {
    throw ConfigError(
        path_.string() + ": cannot write results there: " + error.message() +
        "; choose another --out folder");
  }
}

RunDirectory::~RunDirectory() {
  std::error_code error;
  fs::remove_all(partial_, error);
  // A run that failed leaves no empty folder behind; remove() refuses one that is not empty.
  if (created_) fs::remove(path_, error);
}

fs::path RunDirectory::stage(const std::string& name) {
  const fs::path relative = fs::path(name).lexically_normal();
  if (relative.empty() || relative.is_absolute() || *relative.begin() == ".." ||
      !relative.has_filename()) {
    throw ConfigError(path_.string() + ": '" + name + "' is not a file name inside it");
  }
  const std::string key = relative.generic_string();
  if (std::find(names_.begin(), names_.end(), key) == names_.end()) names_.push_back(key);
  fs::path staged = partial_ / relative;
  std::error_code error;
  fs::create_directories(staged.parent_path(), error);
  if (error) throw ConfigError(staged.string() + ": cannot be created: " + error.message());
  return staged;
}

void RunDirectory::commit() {
  std::stable_partition(
      names_.begin(), names_.end(), [](const std::string& n) { return n != "summary.json"; });
  // The old summary goes first: with it, the new files would look like a complete run.
  std::error_code error;
  if (!names_.empty() && names_.back() == "summary.json") fs::remove(path_ / names_.back(), error);
  for (const std::string& name : names_) {
    const fs::path staged = partial_ / name;
    if (!fs::exists(staged)) continue;
    const fs::path target = path_ / name;
    fs::create_directories(target.parent_path(), error);
    fs::rename(staged, target, error);
    if (error) throw ConfigError(target.string() + ": cannot be written: " + error.message());
  }
  names_.clear();
}

}  // namespace vestibule::io
