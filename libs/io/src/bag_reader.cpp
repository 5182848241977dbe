#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/NavSatFix.h>
#include <tf2_msgs/TFMessage.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>

#include "readers.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::io {
namespace {

constexpr double kMaxTiltCos = 0.985;  // 10 degrees
constexpr int kMaxFrameDepth = 32;

std::string frameName(const std::string& id) {
  return !id.empty() && id.front() == '/' ? id.substr(1) : id;
}

Eigen::Quaterniond toEigen(const geometry_msgs::Quaternion& q) { return {q.w, q.x, q.y, q.z}; }

double yawOf(const Eigen::Matrix3d& R) { return std::atan2(R(1, 0), R(0, 0)); }

/// The fixed transforms of a robot.
class FrameTree {
 public:
  void add(const geometry_msgs::TransformStamped& t) {
    const Eigen::Quaterniond q = toEigen(t.transform.rotation);
    if (!(q.norm() > 0.5)) return;
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = q.normalized().toRotationMatrix();
    const auto& p = t.transform.translation;
    T.translation() << p.x, p.y, p.z;
    parents_[frameName(t.child_frame_id)] = {frameName(t.header.frame_id), T};
  }
  /// T_base_frame, with base_link or else base_footprint as the base.
  [[nodiscard]] std::optional<Eigen::Isometry3d> find(const std::string& frame_id) const {
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

 private:
  struct Link {
    std::string parent;
    Eigen::Isometry3d T;
  };
  std::map<std::string, Link> parents_;
};

class BagReader : public RecordingReader {
 public:
  BagReader(const std::string& path, const RecordingOptions& options)
      : path_(path), rig_(options.rig) {
    try {
      bag_.open(path, rosbag::bagmode::Read);
      readStaticFrames();
      view_.addQuery(bag_, [](const rosbag::ConnectionInfo* c) {
        return c->datatype == "sensor_msgs/NavSatFix" || c->datatype == "sensor_msgs/Imu" ||
               c->datatype == "nav_msgs/Odometry" || c->datatype == "sensor_msgs/LaserScan";
      });
      size_ = view_.size();
      noteOtherTopics();
      it_ = view_.begin();
    } catch (const std::exception& e) {
      fail(e);
    }
    if (size_ == 0) {
      throw InputError(
          path +
          ": no NavSatFix, Imu, Odometry or LaserScan messages in this bag; "
          "record at least one of them");
    }
  }

  std::optional<Record> next() override {
    while (queue_.empty()) {
      try {
        if (it_ == view_.end()) return std::nullopt;
        ++number_;
        take(*it_);
        ++it_;
      } catch (const InputError&) {
        throw;
      } catch (const std::exception& e) {
        fail(e);
      }
    }
    Record record = std::move(queue_.front());
    queue_.pop_front();
    return record;
  }
  [[nodiscard]] double progress() const override {
    return static_cast<double>(number_) / static_cast<double>(size_);
  }
  [[nodiscard]] std::vector<std::string> notes() const override {
    std::vector<std::string> texts = notes_.texts("message");
    texts.insert(texts.end(), topic_notes_.begin(), topic_notes_.end());
    return texts;
  }
  [[nodiscard]] std::string format() const override { return "ROS 1 bag"; }
  [[nodiscard]] const SensorRig& rig() const override { return rig_; }

 private:
  [[noreturn]] void fail(const std::exception& e) const {
    throw InputError(
        path_ + ": " + (number_ > 0 ? "message " + std::to_string(number_) + ": " : "") +
        "the bag is damaged or cut off (" + e.what() + "); try 'rosbag reindex' on a copy");
  }

  void readStaticFrames() {
    rosbag::View frames(bag_, [](const rosbag::ConnectionInfo* c) {
      return c->datatype == "tf2_msgs/TFMessage" && frameName(c->topic) == "tf_static";
    });
    for (const rosbag::MessageInstance& message : frames) {
      const auto tf = message.instantiate<tf2_msgs::TFMessage>();
      if (!tf) continue;
      for (const auto& transform : tf->transforms) frames_.add(transform);
    }
  }

  void noteOtherTopics() {
    rosbag::View all(bag_);
    std::set<std::string> texts;
    std::set<std::string> odometry;
    for (const auto* c : view_.getConnections()) {
      if (c->datatype == "nav_msgs/Odometry") odometry.insert(c->topic);
    }
    for (const auto* c : all.getConnections()) {
      const bool read = c->datatype == "sensor_msgs/NavSatFix" ||
                        c->datatype == "sensor_msgs/Imu" || c->datatype == "nav_msgs/Odometry" ||
                        c->datatype == "sensor_msgs/LaserScan" ||
                        frameName(c->topic) == "tf_static";
      if (!read) texts.insert("topic " + c->topic + " (" + c->datatype + ") ignored");
    }
    topic_notes_.assign(texts.begin(), texts.end());
    if (odometry.size() > 1) {
      std::string text = "several odometry topics; use one of them:";
      for (const auto& topic : odometry) text += " " + topic;
      topic_notes_.push_back(text);
    }
  }

  void take(const rosbag::MessageInstance& message) {
    const std::string& type = message.getDataType();
    if (type == "sensor_msgs/NavSatFix") {
      takeFix(message.getTopic(), instantiate<sensor_msgs::NavSatFix>(message));
    } else if (type == "sensor_msgs/Imu") {
      takeImu(message.getTopic(), instantiate<sensor_msgs::Imu>(message));
    } else if (type == "nav_msgs/Odometry") {
      takeOdometry(message.getTopic(), instantiate<nav_msgs::Odometry>(message));
    } else {
      takeScan(message.getTopic(), instantiate<sensor_msgs::LaserScan>(message));
    }
  }

  template <class T>
  [[nodiscard]] T instantiate(const rosbag::MessageInstance& message) const {
    const auto pointer = message.instantiate<T>();
    if (!pointer) {
      throw InputError(
          path_ + ": message " + std::to_string(number_) + " on " + message.getTopic() +
          ": type definition differs from " + message.getDataType() + " of ROS 1 Noetic");
    }
    return *pointer;
  }

  static Timestamp stampOf(const std_msgs::Header& header) {
    return {static_cast<std::int64_t>(header.stamp.toNSec())};
  }

  void takeFix(const std::string& topic, const sensor_msgs::NavSatFix& m) {
    GnssFix fix;
    fix.stamp = stampOf(m.header);
    const bool finite = std::isfinite(m.latitude) && std::isfinite(m.longitude);
    const bool on_earth = std::abs(m.latitude) <= 90.0 && std::abs(m.longitude) <= 180.0;
    if (m.status.status < 0 || !finite || !on_earth) {
      if (m.status.status >= 0) notes_.add(topic + " fixes without a usable position", number_);
      fix.type = GnssFixType::kNone;
      fix.position = Geodetic{};
      queue_.push_back({number_, topic, fix});
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
        notes_.add(topic + " covariances unusable (zero, negative or NaN)", number_);
      }
    }
    if (const auto T = frames_.find(m.header.frame_id)) {
      rig_.p_base_antenna = {T->translation().x(), T->translation().y()};
    }
    queue_.push_back({number_, topic, fix});
  }

  void takeImu(const std::string& topic, const sensor_msgs::Imu& m) {
    const auto T = frames_.find(m.header.frame_id);
    const Eigen::Matrix3d R_base_imu = T ? Eigen::Matrix3d(T->linear()) : imuMounting(rig_);
    const Timestamp stamp = stampOf(m.header);
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
      queue_.push_back({number_, topic, imu});
    } else {
      notes_.add(topic + " messages without rates", number_);
    }
    if (m.orientation_covariance[0] == -1.0) return;
    const Eigen::Quaterniond q = toEigen(m.orientation);
    if (!(std::abs(q.norm() - 1.0) < 0.05)) {
      notes_.add(topic + " orientations that are no unit quaternion", number_);
      return;
    }
    Heading heading;
    heading.stamp = stamp;
    heading.yaw_rad = yawOf(q.normalized().toRotationMatrix() * R_base_imu.transpose());
    if (m.orientation_covariance[8] > 0.0)
      heading.sigma_rad = std::sqrt(m.orientation_covariance[8]);
    queue_.push_back({number_, topic, heading});
  }

  void takeOdometry(const std::string& topic, const nav_msgs::Odometry& m) {
    const Eigen::Quaterniond q = toEigen(m.pose.pose.orientation);
    const auto& p = m.pose.pose.position;
    if (!(q.norm() > 0.5) || !std::isfinite(p.x) || !std::isfinite(p.y)) {
      notes_.add(topic + " poses unusable (NaN or no quaternion)", number_);
      return;
    }
    const Pose2 T{p.x, p.y, yawOf(q.normalized().toRotationMatrix())};
    if (const auto increment = odometry_[topic].next(stampOf(m.header), T)) {
      queue_.push_back({number_, topic, *increment});
    }
  }

  void takeScan(const std::string& topic, const sensor_msgs::LaserScan& m) {
    LaserScan scan;
    scan.stamp = stampOf(m.header);
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
        notes_.add(topic + " scans of a tilted laser ignored", number_);
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
    queue_.push_back({number_, topic, std::move(scan)});
  }

  std::string path_;
  SensorRig rig_;
  rosbag::Bag bag_;
  rosbag::View view_;
  rosbag::View::iterator it_;
  std::size_t size_ = 0;
  std::size_t number_ = 0;
  FrameTree frames_;
  std::map<std::string, OdometryDifferencer> odometry_;
  std::deque<Record> queue_;
  Notes notes_;
  std::vector<std::string> topic_notes_;
};

}  // namespace

std::unique_ptr<RecordingReader> openBag(const std::string& path, const RecordingOptions& options) {
  return std::make_unique<BagReader>(path, options);
}

}  // namespace vestibule::io
