#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/TwistStamped.h>
#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/MagneticField.h>
#include <sensor_msgs/NavSatFix.h>

#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <string>

#include "readers.hpp"
#include "vestibule/sensors/magnetometer.hpp"

namespace vestibule::io {

/// A frame id without the leading slash of old ROS.
[[nodiscard]] std::string frameName(const std::string& id);

/// True for a twist of this name that is the velocity of a GNSS antenna, as drivers name it
/// (`vel` of nmea_navsat_driver, `fix_velocity` of ublox and others, `gps/vel`), and no command.
[[nodiscard]] bool isGnssVelocity(const std::string& topic);

/// The fixed transforms of a robot.
class FrameTree {
 public:
  void add(const geometry_msgs::TransformStamped& t);
  /// T_base_frame, with base_link or else base_footprint as the base.
  [[nodiscard]] std::optional<Eigen::Isometry3d> find(const std::string& frame_id) const;

 private:
  struct Link {
    std::string parent;
    Eigen::Isometry3d T;
  };
  std::map<std::string, Link> parents_;
};

/// Turns ROS messages into records, whatever kind of bag they come from.
class RosMessages {
 public:
  explicit RosMessages(const SensorRig& rig) : rig_(rig) {}

  [[nodiscard]] FrameTree& frames() { return frames_; }
  /// From now on a fix waits up to 0.2 s of data for the velocity with its stamp.
  void expectVelocities() { velocities_expected_ = true; }
  void take(std::size_t number, const std::string& topic, const sensor_msgs::NavSatFix& m);
  void take(std::size_t number, const std::string& topic, const sensor_msgs::Imu& m);
  void take(std::size_t number, const std::string& topic, const nav_msgs::Odometry& m);
  void take(std::size_t number, const std::string& topic, const sensor_msgs::LaserScan& m);
  void take(std::size_t number, const std::string& topic, const sensor_msgs::MagneticField& m);
  /// Of a topic that isGnssVelocity(), axes ENU.
  void take(std::size_t number, const std::string& topic, const geometry_msgs::TwistStamped& m);
  void take(
      std::size_t number,
      const std::string& topic,
      const geometry_msgs::TwistWithCovarianceStamped& m);
  /// After the last message: nothing more to wait for.
  void finish() { release(); }

  /// The next finished record.
  [[nodiscard]] std::optional<Record> next();
  [[nodiscard]] std::vector<std::string> notes() const { return notes_.texts("message"); }
  [[nodiscard]] const SensorRig& rig() const { return rig_; }

 private:
  void offerVelocity(
      std::size_t number, const std::string& topic, Timestamp stamp, const GnssVelocity& velocity);
  /// Lets the waiting fix go, if it has waited long enough at `now`.
  void releaseBefore(Timestamp now);
  void release();

  SensorRig rig_;
  FrameTree frames_;
  Magnetometer magnetometer_;
  bool orientation_seen_ = false;
  bool velocities_expected_ = false;
  std::optional<Record> waiting_fix_;
  std::optional<std::pair<Timestamp, GnssVelocity>> early_velocity_;
  std::map<std::string, OdometryDifferencer> odometry_;
  std::deque<Record> queue_;
  Notes notes_;
};

}  // namespace vestibule::io
