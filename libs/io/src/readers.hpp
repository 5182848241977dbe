#pragma once

#include <deque>
#include <memory>
#include <string>

#include "byte_stream.hpp"
#include "vestibule/io/csv_mapping.hpp"
#include "vestibule/io/recording.hpp"

namespace vestibule::io {

[[nodiscard]] std::unique_ptr<RecordingReader> openCarmen(
    std::unique_ptr<ByteStream> stream, const RecordingOptions& options);
[[nodiscard]] std::unique_ptr<RecordingReader> openRawlog(
    std::unique_ptr<ByteStream> stream, const RecordingOptions& options);
[[nodiscard]] std::unique_ptr<RecordingReader> openBag(
    const std::string& path, const RecordingOptions& options);
[[nodiscard]] std::unique_ptr<RecordingReader> openRos2Bag(
    const std::string& path, const RecordingOptions& options);
[[nodiscard]] std::unique_ptr<RecordingReader> openCsv(
    std::unique_ptr<ByteStream> stream, const CsvMapping& mapping, const SensorRig& rig);
[[nodiscard]] std::optional<Trajectory> readCsvReference(
    std::unique_ptr<ByteStream> stream, const CsvMapping& mapping);

/// The cells of a row, blanks and surrounding double quotes removed.
[[nodiscard]] std::vector<std::string> splitCsvRow(
    std::string_view line, const std::string& delimiter);

/// The mapping for a CSV file as RecordingOptions says.
[[nodiscard]] CsvMapping chooseCsvMapping(const std::string& path, const RecordingOptions& options);

/// True if the first bytes of a (decompressed) file look like the format.
[[nodiscard]] bool looksLikeRawlog(std::string_view head);
[[nodiscard]] bool looksLikeCarmen(std::string_view head);

/// Turns absolute odometry poses into increments, one instance per odometry source.
class OdometryDifferencer {
 public:
  /// Empty for the first pose.
  [[nodiscard]] std::optional<WheelOdometry> next(Timestamp stamp, const Pose2& T_odom_base);

 private:
  struct Previous {
    Timestamp stamp;
    Pose2 T_odom_base;
  };
  std::optional<Previous> previous_;
};

/// Seconds from a to b, 0 where the stamps do not advance.
[[nodiscard]] inline double intervalSeconds(Timestamp a, Timestamp b) {
  return b > a ? toSeconds(b - a) : 0.0;
}

/// R_base_imu as the rig says.
[[nodiscard]] Eigen::Matrix3d imuMounting(const SensorRig& rig);

}  // namespace vestibule::io
