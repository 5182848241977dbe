#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/io/trajectory.hpp"
#include "vestibule/sensors/measurements.hpp"
#include "vestibule/sensors/rig.hpp"
#include "vestibule/sensors/sweep_slice.hpp"

namespace vestibule::io {

struct RecordingOptions {
  /// Sensor mounting used where the recording does not carry it.
  SensorRig rig;
  /// False: headings as read, deviation of the compass included.
  bool correct_headings = true;
  /// Column mapping of a CSV recording (see csv_mapping.hpp). Empty = the first file (by name) of
  /// csv_mapping_dir whose columns all occur in the header.
  std::string csv_mapping;
  std::string csv_mapping_dir;
  /// Sweeps of lidars with several rings (Velodyne scans and point clouds of an MRPT rawlog) become
  /// scans; empty = they are left out.
  std::optional<SliceParams> slice;
};

/// One measurement and where it came from.
struct Record {
  std::size_t number = 0;  ///< 1-based line (text) or record (binary) in the file
  std::string source;      ///< topic, sensor label or line keyword: "/fix", "LASER", "FLASER"
  Measurement measurement;
};

/// A recording read front to back in constant memory. Records come in file order, which is not
/// always stamp order. Measurements follow the conventions of vestibule::sensors: base axes, ENU,
/// odometry as increments. Poses in `T_log_base` stay in the recording's own frame.
class RecordingReader {
 public:
  RecordingReader() = default;
  RecordingReader(const RecordingReader&) = delete;
  RecordingReader& operator=(const RecordingReader&) = delete;
  virtual ~RecordingReader() = default;

  /// The next record; empty at the end. Throws InputError naming file, line or record, the value
  /// and the remedy for a file that is truncated or garbage.
  [[nodiscard]] virtual std::optional<Record> next() = 0;
  /// Share of the file read, 0..1.
  [[nodiscard]] virtual double progress() const = 0;
  /// What the reader met and survived so far, one text per kind with its count.
  [[nodiscard]] virtual std::vector<std::string> notes() const = 0;
  /// "MRPT rawlog", "CARMEN log", "ROS 1 bag", "ROS 2 bag", "CSV".
  [[nodiscard]] virtual std::string format() const = 0;
  /// Sensor mounting as far as known by now: what the recording carries (poses beside the scans,
  /// tf_static, sensor poses), else RecordingOptions::rig. Read it after the measurement it is for.
  [[nodiscard]] virtual const SensorRig& rig() const = 0;
};

/// Opens a recording by its content: MRPT .rawlog (plain or gz; observations or actions and sensory
/// frames), CARMEN .log/.clf and Wean-Hall logs (plain, gz, bz2), ROS 1 .bag, ROS 2 .db3 (sqlite3),
/// CSV. MRPT stamps have 100 ns ticks; all other formats keep nanoseconds. Throws InputError for a
/// missing, empty or unknown file, ConfigError for a bad column mapping.
[[nodiscard]] std::unique_ptr<RecordingReader> openRecording(
    const std::string& path, const RecordingOptions& options);

/// Reference poses a CSV recording carries (ENU, `T_map_base`); empty for all other formats and for
/// mappings without reference columns.
[[nodiscard]] std::optional<Trajectory> readReference(
    const std::string& path, const RecordingOptions& options);

}  // namespace vestibule::io
