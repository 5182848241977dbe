#include "vestibule/io/rawlog_writer.hpp"

#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/serialization/CArchive.h>

#include <cmath>
#include <map>

#include "mrpt_scan.hpp"
#include "mrpt_sweep.hpp"
#include "mrpt_time.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/sensors/sweep_time.hpp"

namespace vestibule::io {
namespace {

using namespace mrpt::obs;

constexpr int kCompressionLevel = 1;

int qualityOf(GnssFixType type) {
  switch (type) {
    case GnssFixType::kNone:
      return 0;
    case GnssFixType::kSingle:
      return 1;
    case GnssFixType::kDifferential:
      return 2;
    case GnssFixType::kRtkFixed:
      return 4;
    case GnssFixType::kRtkFloat:
      return 5;
    case GnssFixType::kUnknown:
      break;
  }
  return 8;  // NMEA's "simulated": read back as unknown
}

/// Speed and course over ground; RMC knows neither an upward velocity nor a sigma.
gnss::Message_NMEA_RMC courseMessage(const GnssVelocity& velocity) {
  constexpr double kKnot_mps = 1852.0 / 3600.0;
  const Eigen::Vector3d& v = velocity.enu_mps;
  gnss::Message_NMEA_RMC rmc;
  rmc.fields.validity_char = 'A';
  rmc.fields.speed_knots = v.head<2>().norm() / kKnot_mps;
  const double course_deg = radToDeg(std::atan2(v.x(), v.y()));
  rmc.fields.direction_degrees = course_deg < 0.0 ? course_deg + 360.0 : course_deg;
  return rmc;
}

}  // namespace

const char* labelOf(const Measurement& measurement) {
  if (std::holds_alternative<WheelOdometry>(measurement)) return "ODOMETRY";
  if (std::holds_alternative<Imu>(measurement)) return "IMU";
  if (std::holds_alternative<GnssFix>(measurement)) return "GNSS";
  if (std::holds_alternative<Heading>(measurement)) return "HEADING";
  return "LASER";
}

struct RawlogWriter::Impl {
  std::string path;
  mrpt::io::CFileGZOutputStream stream;
  std::map<std::string, Pose2> T_odom_base;  // per label

  void put(CObservation& observation, Timestamp stamp, const std::string& label) {
    observation.timestamp = toMrpt(stamp);
    observation.sensorLabel = label;
    auto archive = mrpt::serialization::archiveFrom(stream);
    archive << observation;
  }

  void write(const WheelOdometry& m, const std::string& label) {
    CObservationOdometry obs;
    auto [it, first] = T_odom_base.try_emplace(label, Pose2{});
    // Increments need a pose to start from.
    if (first) put(obs, m.stamp - durationFromSeconds(m.dt_s), label);
    it->second = compose(it->second, m.T_previous_now);
    obs.odometry = mrpt::poses::CPose2D(it->second);
    put(obs, m.stamp, label);
  }
  void write(const Imu& m, const std::string& label) {
    CObservationIMU obs;
    obs.set(IMU_WX, m.omega_radps.x());
    obs.set(IMU_WY, m.omega_radps.y());
    obs.set(IMU_WZ, m.omega_radps.z());
    obs.set(IMU_X_ACC, m.accel_mps2.x());
    obs.set(IMU_Y_ACC, m.accel_mps2.y());
    obs.set(IMU_Z_ACC, m.accel_mps2.z());
    put(obs, m.stamp, label);
  }
  void write(const Heading& m, const std::string& label) {
    CObservationIMU obs;
    obs.set(IMU_YAW, m.yaw_rad);
    put(obs, m.stamp, label);
  }
  void write(const GnssFix& m, const std::string& label) {
    const auto* position = std::get_if<Geodetic>(&m.position);
    if (position == nullptr) {
      throw ConfigError(
          path + ": a rawlog holds latitude and longitude only, '" + label +
          "' has local metres; give it a datum first");
    }
    gnss::Message_NMEA_GGA gga;
    gga.fields.latitude_degrees = position->lat_deg;
    gga.fields.longitude_degrees = position->lon_deg;
    gga.fields.altitude_meters = position->height_m;
    gga.fields.geoidal_distance = 0.0;
    gga.fields.fix_quality = static_cast<uint8_t>(qualityOf(m.type));
    gga.fields.thereis_HDOP = m.hdop.has_value();
    gga.fields.HDOP = static_cast<float>(m.hdop.value_or(0.0));
    gga.fields.satellitesUsed = static_cast<uint32_t>(m.satellites.value_or(0));
    CObservationGPS obs;
    obs.setMsg(gga);
    if (m.velocity) obs.setMsg(courseMessage(*m.velocity));
    obs.originalReceivedTimestamp = toMrpt(m.stamp);
    obs.has_satellite_timestamp = false;
    put(obs, m.stamp, label);
  }
  void write(const LaserScan& m, const std::string& label) {
    auto obs = toMrpt(m);
    put(obs, m.stamp, label);
  }
};

RawlogWriter::RawlogWriter(const std::string& path) : impl_(std::make_unique<Impl>()) {
  impl_->path = path;
  if (!impl_->stream.open(path, kCompressionLevel)) {
    throw ConfigError(path + ": cannot be created; check the folder");
  }
}

RawlogWriter::~RawlogWriter() = default;

void RawlogWriter::write(const Measurement& measurement, const std::string& label) {
  std::visit([&](const auto& m) { impl_->write(m, label); }, measurement);
}

void RawlogWriter::write(const LidarSweep& sweep, const std::string& label) {
  auto cloud = cloudOf(sweep);
  impl_->put(cloud, meanStamp(sweep), label);
}

void RawlogWriter::close() { impl_->stream.close(); }

}  // namespace vestibule::io
