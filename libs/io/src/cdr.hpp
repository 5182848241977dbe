#pragma once

#include <geometry_msgs/TwistStamped.h>
#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/MagneticField.h>
#include <sensor_msgs/NavSatFix.h>
#include <tf2_msgs/TFMessage.h>

#include <string_view>

namespace vestibule::io {

/// Messages of ROS 2 as its bags store them: OMG Common Data Representation, plain CDR version 1,
/// either byte order. The structs are those of ROS 1, whose fields are the same. Each throws
/// std::runtime_error with what is wrong when the bytes are not that message.
void decodeCdr(std::string_view bytes, sensor_msgs::NavSatFix& m);
void decodeCdr(std::string_view bytes, sensor_msgs::Imu& m);
void decodeCdr(std::string_view bytes, nav_msgs::Odometry& m);
void decodeCdr(std::string_view bytes, sensor_msgs::LaserScan& m);
void decodeCdr(std::string_view bytes, sensor_msgs::MagneticField& m);
void decodeCdr(std::string_view bytes, geometry_msgs::TwistStamped& m);
void decodeCdr(std::string_view bytes, geometry_msgs::TwistWithCovarianceStamped& m);
void decodeCdr(std::string_view bytes, tf2_msgs::TFMessage& m);

}  // namespace vestibule::io
