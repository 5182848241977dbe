#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/io/recording.hpp"

namespace vestibule::io {

/// What one source of a recording holds. Stamps are in file order: first and last are those of the
/// first and last record.
struct SourceInfo {
  std::string source;
  std::string kind;  ///< "laser", "odometry", "imu", "heading", "gnss"
  std::size_t count = 0;
  Timestamp first;
  Timestamp last;
  std::optional<double> rate_hz;  ///< from the median interval of stamps that advance
  double largest_gap_s = 0.0;
  std::size_t backward_stamps = 0;
  std::string detail;  ///< "180 beams, 180.0 deg, 81.9 m", "path 512.3 m", "Differential 989"
};

/// Something a user should know before trusting the recording.
struct Finding {
  std::string source;
  std::string text;
  std::size_t count = 0;
  std::size_t first_record = 0;  ///< 1-based line or record of the first case
};

struct RecordingInfo {
  std::string path;
  std::string format;
  std::uint64_t size_bytes = 0;
  std::optional<Timestamp> first;   ///< smallest valid stamp
  std::optional<Timestamp> last;    ///< largest valid stamp
  std::vector<SourceInfo> sources;  ///< by name, then kind
  std::vector<Finding> findings;
  std::vector<std::string> notes;  ///< from the reader

  /// A table for people, with a newline at the end.
  [[nodiscard]] std::string toText() const;
  /// The same as JSON text, schema versioned.
  [[nodiscard]] std::string toJson() const;
};

/// Reads the whole recording once. \param progress called now and then with 0..1, may be empty
[[nodiscard]] RecordingInfo inspectRecording(
    const std::string& path,
    const RecordingOptions& options,
    const std::function<void(double)>& progress = {});

}  // namespace vestibule::io
