#pragma once

#include <chrono>
#include <string>

#include "vestibule/tuning/engine.hpp"

namespace vestibule::app {

/// The line on the terminal while candidates or runs are done, and what Ctrl-C does: once ends the
/// search, twice everything.
class TuneProgress {
 public:
  /// \param journal  where people find what was done
  explicit TuneProgress(std::string journal);
  TuneProgress(const TuneProgress&) = delete;
  TuneProgress& operator=(const TuneProgress&) = delete;
  ~TuneProgress();

  [[nodiscard]] tuning::Callbacks callbacks();

 private:
  void draw(const tuning::Status& status);

  std::string journal_;
  bool on_terminal_;
  bool drawn_ = false;
  bool stopping_ = false;
  std::string stage_;
  std::chrono::steady_clock::time_point stage_began_;
  std::chrono::steady_clock::time_point last_drawn_;
};

}  // namespace vestibule::app
