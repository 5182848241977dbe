#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/NavSatFix.h>

#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <string>

#include "readers.hpp"

namespace vestibule::io {

/// A frame id without the leading slash of old ROS.
[[nodiscard]] std::string frameName(const std::string& id);

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
  void take(std::size_t number, const std::string& topic, const sensor_msgs::NavSatFix& m);
  void take(std::size_t number, const std::string& topic, const sensor_msgs::Imu& m);
  void take(std::size_t number, const std::string& topic, const nav_msgs::Odometry& m);
  void take(std::size_t number, const std::string& topic, const sensor_msgs::LaserScan& m);

  /// The next finished record.
  [[nodiscard]] std::optional<Record> next();
  [[nodiscard]] std::vector<std::string> notes() const { return notes_.texts("message"); }
  [[nodiscard]] const SensorRig& rig() const { return rig_; }

 private:
  SensorRig rig_;
  FrameTree frames_;
  std::map<std::string, OdometryDifferencer> odometry_;
  std::deque<Record> queue_;
  Notes notes_;
};

}  // namespace vestibule::io
