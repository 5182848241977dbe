#include <mrpt/io/CStream.h>
#include <mrpt/maps/registerAllClasses.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/obs/registerAllClasses.h>
#include <mrpt/serialization/CArchive.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "mrpt_scan.hpp"
#include "mrpt_sweep.hpp"
#include "mrpt_time.hpp"
#include "readers.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/sensors/magnetometer.hpp"

namespace vestibule::io {
namespace {

using namespace mrpt::obs;

constexpr double kTeslaPerGauss = 1e-4;

/// MRPT's stream interface on a ByteStream, with one byte of look-ahead: at an object border that
/// tells the end of the file from an object that is cut off.
class PeekStream : public mrpt::io::CStream {
 public:
  explicit PeekStream(std::unique_ptr<ByteStream> stream) : stream_(std::move(stream)) {}

  [[nodiscard]] bool atEnd() {
    if (!has_peeked_) has_peeked_ = stream_->read(&peeked_, 1) == 1;
    return !has_peeked_;
  }
  size_t Read(void* buffer, size_t size) override {
    auto* out = static_cast<char*>(buffer);
    size_t n = 0;
    if (has_peeked_ && size > 0) {
      out[n++] = peeked_;
      has_peeked_ = false;
    }
    while (n < size) {
      const size_t got = stream_->read(out + n, size - n);
      if (got == 0) break;
      n += got;
    }
    position_ += n;
    return n;
  }
  size_t Write(const void* /*buffer*/, size_t /*size*/) override { return 0; }
  uint64_t Seek(int64_t /*offset*/, TSeekOrigin /*origin*/) override { return position_; }
  [[nodiscard]] uint64_t getTotalBytesCount() const override { return 0; }
  [[nodiscard]] uint64_t getPosition() const override { return position_; }
  [[nodiscard]] const ByteStream& bytes() const { return *stream_; }

 private:
  std::unique_ptr<ByteStream> stream_;
  char peeked_ = 0;
  bool has_peeked_ = false;
  uint64_t position_ = 0;
};

/// Speed and course over ground of an RMC or VTG message.
std::optional<GnssVelocity> toVelocity(const CObservationGPS& obs) {
  using namespace mrpt::obs::gnss;
  constexpr double kKnot_mps = 1852.0 / 3600.0;
  double speed_mps = 0.0;
  double course_deg = 0.0;  // clockwise from true north
  if (obs.hasMsgClass<Message_NMEA_RMC>()) {
    const auto& rmc = obs.getMsgByClass<Message_NMEA_RMC>().fields;
    if (rmc.validity_char != 'A') return std::nullopt;
    speed_mps = kKnot_mps * rmc.speed_knots;
    course_deg = rmc.direction_degrees;
  } else if (obs.hasMsgClass<Message_NMEA_VTG>()) {
    const auto& vtg = obs.getMsgByClass<Message_NMEA_VTG>().fields;
    speed_mps = vtg.ground_speed_kmh / 3.6;
    course_deg = vtg.true_track;
  } else {
    return std::nullopt;
  }
  if (!std::isfinite(speed_mps) || !std::isfinite(course_deg) || speed_mps < 0.0) {
    return std::nullopt;
  }
  const double course_rad = degToRad(course_deg);
  GnssVelocity velocity;
  velocity.enu_mps = {
      speed_mps * std::sin(course_rad),
      speed_mps * std::cos(course_rad),
      std::numeric_limits<double>::quiet_NaN()};
  return velocity;
}

std::optional<GnssFix> toFix(const CObservationGPS& obs) {
  using mrpt::obs::gnss::Message_NMEA_GGA;
  if (!obs.hasMsgClass<Message_NMEA_GGA>()) return std::nullopt;
  const auto& gga = obs.getMsgByClass<Message_NMEA_GGA>().fields;
  GnssFix fix;
  fix.stamp = fromMrpt(obs.timestamp);
  switch (gga.fix_quality) {
    case 0:
      fix.type = GnssFixType::kNone;
      break;
    case 1:
      fix.type = GnssFixType::kSingle;
      break;
    case 2:
      fix.type = GnssFixType::kDifferential;
      break;
    case 4:
      fix.type = GnssFixType::kRtkFixed;
      break;
    case 5:
      fix.type = GnssFixType::kRtkFloat;
      break;
    default:
      fix.type = GnssFixType::kUnknown;
  }
  // GGA heights are above the geoid.
  fix.position = Geodetic{
      gga.latitude_degrees, gga.longitude_degrees, gga.altitude_meters + gga.geoidal_distance};
  if (gga.thereis_HDOP) fix.hdop = static_cast<double>(gga.HDOP);
  fix.satellites = static_cast<int>(gga.satellitesUsed);
  fix.velocity = toVelocity(obs);
  return fix;
}

class RawlogReader : public RecordingReader {
 public:
  RawlogReader(std::unique_ptr<ByteStream> stream, const RecordingOptions& options)
      : rig_(options.rig), slice_(options.slice), stream_(std::move(stream)) {
    mrpt::obs::registerAllClasses_mrpt_obs();
    mrpt::maps::registerAllClasses_mrpt_maps();
    archive_ = mrpt::serialization::archivePtrFrom(static_cast<mrpt::io::CStream&>(stream_));
  }

  std::optional<Record> next() override {
    while (queue_.empty()) {
      if (stream_.atEnd()) return std::nullopt;
      ++number_;
      take(readObject());
    }
    Record record = std::move(queue_.front());
    queue_.pop_front();
    return record;
  }
  [[nodiscard]] double progress() const override { return stream_.bytes().progress(); }
  [[nodiscard]] std::vector<std::string> notes() const override { return notes_.texts("record"); }
  [[nodiscard]] std::string format() const override { return "MRPT rawlog"; }
  [[nodiscard]] const SensorRig& rig() const override { return rig_; }

 private:
  mrpt::serialization::CSerializable::Ptr readObject() {
    std::string reason;
    try {
      auto object = archive_->ReadObject();
      if (object) return object;
      reason = "empty object";
    } catch (const InputError&) {
      throw;
    } catch (const std::bad_alloc&) {
      reason = "impossible size";
    } catch (const std::exception& e) {
      // MRPT adds a call stack: only its first line says what happened.
      const std::string text = e.what();
      reason = text.substr(0, text.find('\n'));
    }
    throw InputError(
        stream_.bytes().name() + ": record " + std::to_string(number_) + " (byte " +
        std::to_string(stream_.getPosition()) + "): " +
        (stream_.atEnd() ? "the rawlog is cut off" : "damaged or unknown object (" + reason + ")") +
        "; " + std::to_string(number_ - 1) + " records before it are readable");
  }

  void take(const mrpt::serialization::CSerializable::Ptr& object) {
    if (const auto observation = std::dynamic_pointer_cast<CObservation>(object)) {
      take(*observation);
    } else if (const auto actions = std::dynamic_pointer_cast<CActionCollection>(object)) {
      takeActions(*actions);
    } else if (const auto frame = std::dynamic_pointer_cast<CSensoryFrame>(object)) {
      takeFrame(*frame);
    } else {
      ignore(object->GetRuntimeClass()->className);
    }
  }

  /// Actions are stamped with the frame that follows (their own stamps are often invalid).
  void takeActions(CActionCollection& actions) {
    const auto movement = actions.getBestMovementEstimation();
    if (!movement) return;
    const auto increment =
        movement->estimationMethod == CActionRobotMovement2D::emOdometry || !movement->poseChange
            ? movement->rawOdometryIncrementReading
            : movement->poseChange->getMeanVal();
    const Pose2 T = increment.asTPose();
    pending_increment_ = pending_increment_ ? compose(*pending_increment_, T) : T;
  }

  void takeFrame(CSensoryFrame& frame) {
    std::optional<Timestamp> stamp;
    for (const auto& observation : frame) {
      if (observation->timestamp == INVALID_TIMESTAMP) continue;
      const bool is_scan = IS_CLASS(*observation, CObservation2DRangeScan);
      if (!stamp || is_scan) stamp = fromMrpt(observation->timestamp);
      if (is_scan) break;
    }
    if (pending_increment_) {
      if (!stamp) {
        notes_.add("odometry of a frame without a stamp dropped", number_);
      } else {
        const double dt_s = frame_stamp_ ? intervalSeconds(*frame_stamp_, *stamp) : 0.0;
        queue_.push_back(
            {number_, "action", WheelOdometry{*stamp, dt_s, *pending_increment_, true}});
      }
      pending_increment_.reset();
    }
    if (stamp) frame_stamp_ = stamp;
    for (const auto& observation : frame) take(*observation);
  }

  void take(const CObservation& observation) {
    if (const auto* scan = dynamic_cast<const CObservation2DRangeScan*>(&observation)) {
      auto converted = fromMrpt(*scan);
      if (!converted) {
        notes_.add("scans of a tilted laser ignored", number_);
        return;
      }
      rig_.T_base_laser = converted->T_base_laser;
      push(observation, std::move(*converted));
    } else if (const auto* odometry = dynamic_cast<const CObservationOdometry*>(&observation)) {
      auto& source = odometry_[odometry->sensorLabel];
      const auto increment =
          source.next(fromMrpt(odometry->timestamp), odometry->odometry.asTPose());
      if (increment) push(observation, *increment);
    } else if (const auto* gps = dynamic_cast<const CObservationGPS*>(&observation)) {
      if (auto fix = toFix(*gps)) {
        const auto& mount = gps->sensorPose;
        if (!antenna_known_ && (mount.x() != 0.0 || mount.y() != 0.0)) {
          rig_.p_base_antenna = {mount.x(), mount.y()};  // of the first of several receivers
          antenna_known_ = true;
        }
        push(observation, std::move(*fix));
      } else {
        notes_.add("GPS records without a GGA message ignored", number_);
      }
    } else if (const auto* imu = dynamic_cast<const CObservationIMU*>(&observation)) {
      takeImu(*imu);
    } else if (const auto sweep = slice_ ? sweepOf(observation) : std::nullopt) {
      LaserScan sliced = sliceSweep(*sweep, *slice_);
      rig_.T_base_laser = sliced.T_base_laser;
      push(observation, std::move(sliced));
    } else {
      ignore(observation.GetRuntimeClass()->className);
    }
  }

  void takeImu(const CObservationIMU& obs) {
    const bool carried = obs.sensorPose.yaw() != 0.0 || obs.sensorPose.pitch() != 0.0 ||
                         obs.sensorPose.roll() != 0.0;
    const Eigen::Matrix3d R_base_imu =
        carried ? Eigen::Matrix3d(obs.sensorPose.getRotationMatrix().asEigen()) : imuMounting(rig_);
    const auto vector = [&](TIMUDataIndex x, TIMUDataIndex y, TIMUDataIndex z) {
      const auto get = [&](TIMUDataIndex i) { return obs.has(i) ? obs.get(i) : 0.0; };
      return Eigen::Vector3d(R_base_imu * Eigen::Vector3d(get(x), get(y), get(z)));
    };
    const Timestamp stamp = fromMrpt(obs.timestamp);
    if (obs.has(IMU_WZ) || obs.has(IMU_X_ACC)) {
      const Imu imu{stamp, vector(IMU_WX, IMU_WY, IMU_WZ), vector(IMU_X_ACC, IMU_Y_ACC, IMU_Z_ACC)};
      magnetometer_.take(imu);
      push(obs, imu);
    }
    if (obs.has(IMU_YAW)) {
      const double mount_yaw = std::atan2(R_base_imu(1, 0), R_base_imu(0, 0));
      push(
          obs,
          rig_.compass.corrected(
              {stamp, angleDiff(obs.get(IMU_YAW), mount_yaw), std::nullopt, std::nullopt}));
    } else if (obs.has(IMU_MAG_X) && obs.has(IMU_MAG_Y) && obs.has(IMU_MAG_Z)) {
      const auto reading =
          magnetometer_.read(stamp, kTeslaPerGauss * vector(IMU_MAG_X, IMU_MAG_Y, IMU_MAG_Z));
      if (reading.heading) {
        push(obs, rig_.compass.corrected(*reading.heading));
      } else {
        notes_.add("magnetic fields " + reading.refused, number_);
      }
    }
  }

  void push(const CObservation& observation, Measurement measurement) {
    if (observation.timestamp == INVALID_TIMESTAMP) {
      notes_.add("observations with an invalid stamp (kept, stamp 0)", number_);
    }
    const std::string source = observation.sensorLabel.empty()
                                   ? std::string(observation.GetRuntimeClass()->className)
                                   : observation.sensorLabel;
    queue_.push_back({number_, source, std::move(measurement)});
  }

  void ignore(const std::string& class_name) {
    notes_.add(class_name + " objects ignored", number_);
  }

  SensorRig rig_;
  Magnetometer magnetometer_;
  std::optional<SliceParams> slice_;
  PeekStream stream_;
  mrpt::serialization::CArchive::Ptr archive_;
  std::size_t number_ = 0;
  std::deque<Record> queue_;
  std::map<std::string, OdometryDifferencer> odometry_;
  std::optional<Pose2> pending_increment_;
  std::optional<Timestamp> frame_stamp_;
  bool antenna_known_ = false;
  Notes notes_;
};

}  // namespace

bool looksLikeRawlog(std::string_view head) {
  // An object starts with its class name's length (top bit set in the present format, clear before
  // 2006), then the name: "CSensoryFrame", "mrpt::obs::CObservation...".
  if (head.size() < 2) return false;
  const std::size_t length = static_cast<unsigned char>(head[0]) & 0x7FU;
  const std::string_view name = head.substr(1, length);
  if (length < 4 || name.empty()) return false;
  if (name.front() != 'C' && name.substr(0, 6) != "mrpt::") return false;
  return std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '_' ||
           c == ':';
  });
}

std::unique_ptr<RecordingReader> openRawlog(
    std::unique_ptr<ByteStream> stream, const RecordingOptions& options) {
  return std::make_unique<RawlogReader>(std::move(stream), options);
}

}  // namespace vestibule::io
