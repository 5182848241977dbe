#pragma once

#include <string>
#include <utility>
#include <vector>

#include "vestibule/core/errors.hpp"
#include "vestibule/tuning/session.hpp"

namespace vestibule::tuning {

/// What sessions and suites have in common.

extern const std::vector<std::pair<std::string_view, SubjectKind>> kSubjects;

void describe(ParamIo& io, RecordingSpec& r);
void describe(ParamIo& io, Objective& o);
void describe(ParamIo& io, Seeds& s);

/// Reads a path, relative to the file, of a file that must be there. Empty stays empty.
void requireFile(ParamIo& io, const char* key, std::string& path);
/// The configuration of a file, the defaults without one; a problem of it is one of `io`'s file.
[[nodiscard]] pipeline::Config baseConfig(ParamIo& io, const char* key, const std::string& path);

/// What is found out after reading, with the lines remembered from it.
class Problems {
 public:
  explicit Problems(std::string file) : file_(std::move(file)) {}
  void add(const SourceRef& where, const std::string& key, const std::string& text);
  /// What reading itself complained of: lines "file:line: ...".
  void add(const ConfigError& e);
  /// Throws them all, in the order of the file.
  void raise();

 private:
  std::string file_;
  std::vector<std::pair<int, std::string>> lines_;
};

/// Whether the subject can be measured so.
void checkObjectives(Problems& problems, const Session& session);
/// What each kind of run needs beside its recording, and whether scenarios are there.
/// \param prefix  key of the recordings; "recordings." gets the role behind it
void checkRecordings(
    Problems& problems,
    const Session& session,
    const std::string& scenario_folder,
    const std::string& prefix);

}  // namespace vestibule::tuning
