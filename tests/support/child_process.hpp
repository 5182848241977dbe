#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace vestibule::test {

struct CommandResult {
  int exit_code = -1;  ///< -1 when a signal ended it
  int signal = 0;      ///< that signal
  std::string out;
  std::string err;
};

/// A program run as a child process without a terminal; it does not outlive the object.
class ChildProcess {
 public:
  /// \param command the program's path and its arguments
  /// \param folder  its working folder, where its output is collected; exists
  ChildProcess(const std::vector<std::string>& command, const std::filesystem::path& folder);
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;
  ~ChildProcess();

  [[nodiscard]] bool running();
  void sendSignal(int signal) const;
  /// Waits for its end.
  [[nodiscard]] CommandResult wait();

 private:
  std::filesystem::path out_file_;
  std::filesystem::path err_file_;
  pid_t pid_ = -1;
  bool ended_ = false;
  int status_ = 0;
};

/// Runs a program to its end.
[[nodiscard]] CommandResult runCommand(
    const std::vector<std::string>& command, const std::filesystem::path& folder);

}  // namespace vestibule::test
