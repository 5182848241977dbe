#pragma once

#include <fstream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "vestibule/tuning/scoring.hpp"

namespace vestibule::tuning {

/// Everything that was tried, one JSON object per line in evaluations.jsonl, appended as soon as it
/// is known. A session that was killed goes on from it: what stands there is not run again.
class Journal {
 public:
  /// \param path         empty: nothing is kept
  /// \param fingerprint  of the session; its first line
  /// \param with_cpu     keeps the runs' CPU time, which differs from time to time
  /// Throws ConfigError when the file belongs to another session. A last line that was cut off is
  /// dropped. The file is made with the first evaluation.
  Journal(std::string path, const std::string& fingerprint, bool with_cpu = false);

  /// What is known of a candidate on a set of runs.
  [[nodiscard]] const Evaluation* find(
      const std::string& set, const std::vector<double>& values) const;
  /// \param cost  as it was judged, for readers of the file
  void append(const std::string& set, const Evaluation& evaluation, double cost);
  /// Evaluations that were there from an earlier run.
  [[nodiscard]] std::size_t resumed() const { return resumed_; }

 private:
  void read();
  void open();

  std::string path_;
  std::string fingerprint_;
  bool with_cpu_;
  std::ofstream out_;
  std::map<std::pair<std::string, std::vector<double>>, Evaluation> known_;
  std::size_t resumed_ = 0;
};

}  // namespace vestibule::tuning
