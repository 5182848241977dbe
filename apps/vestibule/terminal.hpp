#pragma once

#include <chrono>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "vestibule/pipeline/progress.hpp"

namespace vestibule::app {

/// Thrown out of a run when the user pressed Ctrl-C (SIGINT) or the system sent SIGTERM; unwinding
/// removes what was not committed.
class Interrupted : public std::runtime_error {
 public:
  explicit Interrupted(const std::string& text = "interrupted; nothing was written")
      : std::runtime_error(text) {}
};
void installSignalHandlers();
/// Throws Interrupted once a signal has come.
void checkInterrupted();
/// Whether a signal has come since the last time; for runs that end gracefully.
[[nodiscard]] bool takeInterrupt();

/// Remembers what was typed, for the reports.
void noteCommandLine(int argc, char** argv);
/// What to type to get a report again: without the output folder, and without --resume.
[[nodiscard]] std::string commandLine();

/// A line on the terminal with share, rate and time left; silent when standard error is not one.
/// Also where a run notices Ctrl-C.
class ProgressBar {
 public:
  explicit ProgressBar(std::string label);
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  ~ProgressBar();

  [[nodiscard]] pipeline::Progress callback();
  /// What is going on, from now on.
  void setLabel(std::string label) { label_ = std::move(label); }
  /// Wall time since construction [s].
  [[nodiscard]] double wallSeconds() const;

 private:
  void draw(double share, double data_s);

  std::string label_;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_drawn_;
  bool on_terminal_;
  bool drawn_ = false;
};

/// Number with a fixed count of decimals.
[[nodiscard]] std::string fixed(double value, int decimals);

/// Aligned columns, the first row as a heading.
[[nodiscard]] std::string textTable(const std::vector<std::vector<std::string>>& rows);

}  // namespace vestibule::app
