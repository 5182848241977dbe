#include "ros_messages.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "vestibule/core/angles.hpp"

namespace vestibule::io {
namespace {

constexpr double kMaxTiltCos = 0.985;  // 10 degrees
constexpr int kMaxFrameDepth = 32;
constexpr double kSameFix_s = 0.02;
constexpr double kFixWaits_s = 0.2;

Eigen::Quaterniond toEigen(const geometry_msgs::Quaternion& q) { return {q.w, q.x, q.y, q.z}; }

double yawOf(const Eigen::Matrix3d& R) { return std::atan2(R(1, 0), R(0, 0)); }

Timestamp stampOf(const std_msgs::Header& header) {
  return {static_cast<std::int64_t>(header.stamp.toNSec())};
}

bool sameFix(Timestamp a, Timestamp b) { return std::abs(toSeconds(a - b)) <= kSameFix_s; }

GnssVelocity toVelocity(const geometry_msgs::Twist& twist) {
  return {{twist.linear.x, twist.linear.y, twist.linear.z}, std::nullopt};
}

}  // namespace

std::string frameName(const std::string& id) {
  return !id.empty() && id.front() == '/' ? id.substr(1) : id;
}

bool isGnssVelocity(const std::string& topic) {
  const std::string name = frameName(topic);
  const std::string last = name.substr(name.rfind('/') + 1);
  if (last == "fix_velocity" || name == "vel") return true;
  if (last != "vel" && last != "velocity") return false;
  const auto from = {"gps", "gnss", "navsat", "nmea", "ublox"};
  return std::any_of(from.begin(), from.end(), [&name](const char* device) {
    return name.find(device) != std::string::npos;
  });
}

void FrameTree::add(const geometry_msgs::TransformStamped& t) {
  const Eigen::Quaterniond q = toEigen(t.transform.rotation);
  if (!(q.norm() > 0.5)) return;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = q.normalized().toRotationMatrix();
  const auto& p = t.transform.translation;
  T.translation() << p.x, p.y, p.z;
  parents_[frameName(t.child_frame_id)] = {frameName(t.header.frame_id), T};
}

std::optional<Eigen::Isometry3d> FrameTree::find(const std::string& frame_id) const {
  for (const char* base : {"base_link", "base_footprint"}) {
    std::string frame = frameName(frame_id);
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    for (int depth = 0; depth < kMaxFrameDepth; ++depth) {
      if (frame == base) return T;
      const auto it = parents_.find(frame);
      if (it == parents_.end()) break;
      T = it->second.T * T;
      frame = it->second.parent;
    }
  }
  return std::nullopt;
}

std::optional<Record> RosMessages::next() {
  if (queue_.empty()) return std::nullopt;
  Record record = std::move(queue_.front());
  queue_.pop_front();
  return record;
}

void RosMessages::take(
    std::size_t number, const std::string& topic, const sensor_msgs::NavSatFix& m) {
  GnssFix fix;
  fix.stamp = stampOf(m.header);
  release();
  const bool finite = std::isfinite(m.latitude) && std::isfinite(m.longitude);
  const bool on_earth = std::abs(m.latitude) <= 90.0 && std::abs(m.longitude) <= 180.0;
  if (m.status.status < 0 || !finite || !on_earth) {
    if (m.status.status >= 0) notes_.add(topic + " fixes without a usable position", number);
    fix.type = GnssFixType::kNone;
    fix.position = Geodetic{};
    queue_.push_back({number, topic, fix});
    return;
  }
  // GBAS covers everything from code differences to fixed RTK: claim the weakest.
  fix.type = m.status.status == 0 ? GnssFixType::kSingle : GnssFixType::kDifferential;
  fix.position = Geodetic{m.latitude, m.longitude, std::isfinite(m.altitude) ? m.altitude : 0.0};
  if (m.position_covariance_type != sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN) {
    const Eigen::Matrix3d cov = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
        m.position_covariance.data());
    if (cov.allFinite() && cov.diagonal().minCoeff() > 0.0) {
      fix.cov_enu = 0.5 * (cov + cov.transpose());
    } else {
      notes_.add(topic + " covariances unusable (zero, negative or NaN)", number);
    }
  }
  if (const auto T = frames_.find(m.header.frame_id)) {
    rig_.p_base_antenna = {T->translation().x(), T->translation().y()};
  }
  if (early_velocity_ && sameFix(early_velocity_->first, fix.stamp)) {
    fix.velocity = early_velocity_->second;
  }
  waiting_fix_ = Record{number, topic, fix};
  if (!velocities_expected_ || fix.velocity) release();
}

void RosMessages::release() {
  if (waiting_fix_) queue_.push_back(*std::exchange(waiting_fix_, std::nullopt));
}

void RosMessages::releaseBefore(Timestamp now) {
  if (!waiting_fix_) return;
  const Timestamp stamp = vestibule::stampOf(waiting_fix_->measurement);
  if (toSeconds(now - stamp) > kFixWaits_s) release();
}

void RosMessages::offerVelocity(
    std::size_t number, const std::string& topic, Timestamp stamp, const GnssVelocity& velocity) {
  // The filter asks for both level axes; the third is free to be unknown.
  if (!velocity.enu_mps.head<2>().allFinite()) {
    notes_.add(topic + " velocities unusable (NaN)", number);
    return;
  }
  early_velocity_ = {stamp, velocity};
  if (!waiting_fix_) return;
  auto& fix = std::get<GnssFix>(waiting_fix_->measurement);
  if (sameFix(fix.stamp, stamp)) {
    fix.velocity = velocity;
    release();
  }
}

void RosMessages::take(
    std::size_t number, const std::string& topic, const geometry_msgs::TwistStamped& m) {
  offerVelocity(number, topic, stampOf(m.header), toVelocity(m.twist));
}

void RosMessages::take(
    std::size_t number,
    const std::string& topic,
    const geometry_msgs::TwistWithCovarianceStamped& m) {
  GnssVelocity velocity = toVelocity(m.twist.twist);
  const double variance = std::max(m.twist.covariance[0], m.twist.covariance[7]);
  if (variance > 0.0 && std::isfinite(variance)) velocity.sigma_mps = std::sqrt(variance);
  offerVelocity(number, topic, stampOf(m.header), velocity);
}

void RosMessages::take(
    std::size_t number, const std::string& topic, const sensor_msgs::MagneticField& m) {
  releaseBefore(stampOf(m.header));
  const Eigen::Vector3d field(m.magnetic_field.x, m.magnetic_field.y, m.magnetic_field.z);
  if (!field.allFinite()) {
    notes_.add(topic + " fields unusable (NaN)", number);
    return;
  }
  if (orientation_seen_) {
    notes_.add(topic + " fields left out: the orientation of the IMU has them in it", number);
    return;
  }
  const auto T = frames_.find(m.header.frame_id);
  const Eigen::Matrix3d R_base_sensor = T ? Eigen::Matrix3d(T->linear()) : imuMounting(rig_);
  const auto reading = magnetometer_.read(stampOf(m.header), R_base_sensor * field);
  if (!reading.heading) {
    notes_.add(topic + " fields " + reading.refused, number);
    return;
  }
  queue_.push_back({number, topic, rig_.compass.corrected(*reading.heading)});
}

void RosMessages::take(std::size_t number, const std::string& topic, const sensor_msgs::Imu& m) {
  const auto T = frames_.find(m.header.frame_id);
  const Eigen::Matrix3d R_base_imu = T ? Eigen::Matrix3d(T->linear()) : imuMounting(rig_);
  const Timestamp stamp = stampOf(m.header);
  releaseBefore(stamp);
  // A first covariance element of -1 says that the device does not have the quantity.
  if (m.angular_velocity_covariance[0] != -1.0) {
    Imu imu;
    imu.stamp = stamp;
    imu.omega_radps =
        R_base_imu *
        Eigen::Vector3d(m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z);
    if (m.linear_acceleration_covariance[0] != -1.0) {
      imu.accel_mps2 =
          R_base_imu *
          Eigen::Vector3d(
              m.linear_acceleration.x, m.linear_acceleration.y, m.linear_acceleration.z);
    }
    magnetometer_.take(imu);
    queue_.push_back({number, topic, imu});
  } else {
    notes_.add(topic + " messages without rates", number);
  }
  if (m.orientation_covariance[0] == -1.0) return;
  const Eigen::Quaterniond q = toEigen(m.orientation);
  if (!(std::abs(q.norm() - 1.0) < 0.05)) {
    notes_.add(topic + " orientations that are no unit quaternion", number);
    return;
  }
  orientation_seen_ = true;
  Heading heading;
  heading.stamp = stamp;
  const Eigen::Matrix3d R = q.normalized().toRotationMatrix() * R_base_imu.transpose();
  heading.yaw_rad = yawOf(R);
  heading.tilt = Tilt{std::atan2(R(2, 1), R(2, 2)), -std::asin(std::clamp(R(2, 0), -1.0, 1.0))};
  if (m.orientation_covariance[8] > 0.0) heading.sigma_rad = std::sqrt(m.orientation_covariance[8]);
  queue_.push_back({number, topic, rig_.compass.corrected(heading)});
}

void RosMessages::take(std::size_t number, const std::string& topic, const nav_msgs::Odometry& m) {
  releaseBefore(stampOf(m.header));
  const Eigen::Quaterniond q = toEigen(m.pose.pose.orientation);
  const auto& p = m.pose.pose.position;
  if (!(q.norm() > 0.5) || !std::isfinite(p.x) || !std::isfinite(p.y)) {
    notes_.add(topic + " poses unusable (NaN or no quaternion)", number);
    return;
  }
  const Pose2 T{p.x, p.y, yawOf(q.normalized().toRotationMatrix())};
  if (const auto increment = odometry_[topic].next(stampOf(m.header), T)) {
    queue_.push_back({number, topic, *increment});
  }
}

void RosMessages::take(
    std::size_t number, const std::string& topic, const sensor_msgs::LaserScan& m) {
  LaserScan scan;
  scan.stamp = stampOf(m.header);
  releaseBefore(scan.stamp);
  scan.angle_min_rad = static_cast<double>(m.angle_min);
  scan.angle_step_rad = static_cast<double>(m.angle_increment);
  scan.range_min_m = static_cast<double>(m.range_min);
  scan.range_max_m = static_cast<double>(m.range_max);
  scan.ranges_m = m.ranges;
  scan.T_base_laser = rig_.T_base_laser;
  bool upside_down = false;
  if (const auto T = frames_.find(m.header.frame_id)) {
    const double up = T->linear()(2, 2);
    if (std::abs(up) < kMaxTiltCos) {
      notes_.add(topic + " scans of a tilted laser ignored", number);
      return;
    }
    upside_down = up < 0.0;
    scan.T_base_laser = {T->translation().x(), T->translation().y(), yawOf(T->linear())};
    rig_.T_base_laser = scan.T_base_laser;
  }
  // Counter-clockwise seen from above, whatever the device and its mounting do.
  const auto n = static_cast<double>(scan.ranges_m.size());
  const double last = scan.angle_min_rad + (n - 1.0) * scan.angle_step_rad;
  if (upside_down != (scan.angle_step_rad < 0.0)) {
    std::reverse(scan.ranges_m.begin(), scan.ranges_m.end());
    scan.angle_min_rad = upside_down ? -last : last;
    scan.angle_step_rad = std::abs(scan.angle_step_rad);
  } else if (upside_down) {
    scan.angle_min_rad = -scan.angle_min_rad;
    scan.angle_step_rad = -scan.angle_step_rad;
  }
  queue_.push_back({number, topic, std::move(scan)});
}

}  // namespace vestibule::io
