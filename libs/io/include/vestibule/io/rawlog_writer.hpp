#pragma once

#include <memory>
#include <string>

#include "vestibule/sensors/measurements.hpp"

namespace vestibule::io {

/// Sensor label of a simulated measurement in a recording.
[[nodiscard]] const char* labelOf(const Measurement& measurement);

/// Writes measurements as an MRPT rawlog (observations format, gz) that MRPT's tools and
/// openRecording() read back: odometry as CObservationOdometry (increments integrated to an
/// absolute pose), scans as CObservation2DRangeScan, IMU and headings as CObservationIMU, fixes as
/// CObservationGPS with a GGA message.
///
/// What the format cannot hold: stamps keep 100 ns ticks (mrpt::Clock; nanoseconds are rounded),
/// ranges and angles of scans are single precision, a scan's time from beam to beam is not kept,
/// fixes keep type, HDOP and satellites but no covariance, and only geodetic positions (a
/// LocalPosition needs its datum: it throws ConfigError).
class RawlogWriter {
 public:
  /// Throws ConfigError when the file cannot be created.
  explicit RawlogWriter(const std::string& path);
  RawlogWriter(const RawlogWriter&) = delete;
  RawlogWriter& operator=(const RawlogWriter&) = delete;
  ~RawlogWriter();

  /// \param label  sensor label of the record; the reader gives it back as `Record::source`
  void write(const Measurement& measurement, const std::string& label);
  /// As CObservationPointCloud: rings and times of points are lost.
  void write(const LidarSweep& sweep, const std::string& label);
  /// Flushes and closes; no write() after it. The destructor closes too.
  void close();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vestibule::io
