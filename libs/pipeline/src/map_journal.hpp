#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "vestibule/mapping/rbpf.hpp"

namespace vestibule::pipeline {

/// The outcome of every update of a mapping run, appended as it comes: all that a killed run needs
/// to go on. A record that was cut off by the kill is dropped; nothing before it can be damaged.
class MapJournal {
 public:
  /// \param identity of recording and configuration: a journal of another run is refused
  /// \param resume   go on with what is there; else start anew
  /// Throws ConfigError when the file cannot be written or is of another run.
  MapJournal(std::string path, std::uint64_t identity, std::size_t particles, bool resume);

  /// What the file held when it was opened.
  [[nodiscard]] std::vector<mapping::Generation> takeRecorded() { return std::move(recorded_); }
  void append(const mapping::Generation& generation);

 private:
  std::string path_;
  std::size_t particles_;
  std::vector<mapping::Generation> recorded_;
  std::string header_;  // not written yet
  std::ofstream out_;
};

}  // namespace vestibule::pipeline
