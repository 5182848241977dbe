#include <geometry_msgs/TwistStamped.h>
#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <gmock/gmock.h>
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/MagneticField.h>
#include <sensor_msgs/NavSatFix.h>
#include <tf2_msgs/TFMessage.h>

#include <cmath>
#include <limits>

#include "matchers.hpp"
#include "temp_files.hpp"
#include "vestibule/core/angles.hpp"

namespace vestibule::io {
namespace {

using testing::HasSubstr;

geometry_msgs::Quaternion rotation(double roll, double yaw) {
  geometry_msgs::Quaternion q;
  q.w = std::cos(yaw / 2) * std::cos(roll / 2);
  q.x = std::cos(yaw / 2) * std::sin(roll / 2);
  q.y = std::sin(yaw / 2) * std::sin(roll / 2);
  q.z = std::sin(yaw / 2) * std::cos(roll / 2);
  return q;
}

geometry_msgs::TransformStamped link(
    const std::string& parent, const std::string& child, double x, double roll, double yaw) {
  geometry_msgs::TransformStamped t;
  t.header.frame_id = parent;
  t.child_frame_id = child;
  t.transform.translation.x = x;
  t.transform.rotation = rotation(roll, yaw);
  return t;
}

std::string writeBag(const std::filesystem::path& path) {
  rosbag::Bag bag(path.string(), rosbag::bagmode::Write);
  for (int i = 0; i < 5; ++i) {
    const ros::Time t(1000 + static_cast<unsigned>(i), 5);
    nav_msgs::Odometry odometry;
    odometry.header.stamp = t;
    odometry.pose.pose.position.x = 0.5 * i;
    odometry.pose.pose.orientation = rotation(0.0, 0.0);
    bag.write("/odom", t, odometry);

    sensor_msgs::NavSatFix fix;
    fix.header.stamp = t;
    fix.header.frame_id = "gps";
    fix.latitude = 42.0;
    fix.longitude = -71.0;
    fix.altitude = i == 4 ? std::numeric_limits<double>::quiet_NaN() : 20.0;
    fix.status.status = static_cast<signed char>(i - 1);
    fix.position_covariance_type = i == 3 ? 0 : 2;
    for (std::size_t k : {0U, 4U, 8U}) fix.position_covariance[k] = i == 3 ? 0.0 : 4.0;
    bag.write("/fix", t, fix);

    sensor_msgs::Imu imu;
    imu.header.stamp = t;
    imu.header.frame_id = "imu";
    imu.orientation = rotation(kPi, 0.4);
    imu.orientation_covariance[0] = i == 0 ? -1.0 : 0.01;
    imu.orientation_covariance[8] = 0.04;
    imu.angular_velocity.z = -0.2;
    imu.linear_acceleration.z = -9.8;
    bag.write("/imu", t, imu);

    sensor_msgs::LaserScan scan;
    scan.header.stamp = t;
    scan.header.frame_id = "/laser";
    scan.angle_min = -1.0F;
    scan.angle_increment = 0.5F;
    scan.angle_max = 1.0F;
    scan.range_max = 10.0F;
    scan.ranges = {1.0F, 2.0F, std::numeric_limits<float>::infinity(), 4.0F, 5.0F};
    bag.write("/scan", t, scan);
  }
  // Static transforms late in the file still hold from the start.
  tf2_msgs::TFMessage tf;
  tf.transforms = {
      link("base_link", "mast", 0.3, 0.0, 0.0),
      link("mast", "laser", 0.1, kPi, 0.0),
      link("base_link", "imu", 0.0, kPi, 0.0),
      link("base_link", "gps", -0.2, 0.0, 0.0)};
  bag.write("/tf_static", ros::Time(1004, 6), tf);
  bag.close();
  return path.string();
}

TEST(Bag, MessagesBecomeMeasurements) {
  const auto reader = openRecording(writeBag(testFolder() / "a.bag"), {});
  std::vector<WheelOdometry> odometry;
  std::vector<GnssFix> fixes;
  std::vector<Imu> imu;
  std::vector<Heading> headings;
  std::vector<LaserScan> scans;
  while (const auto record = reader->next()) {
    const Measurement& m = record->measurement;
    if (const auto* p = std::get_if<WheelOdometry>(&m)) odometry.push_back(*p);
    if (const auto* p = std::get_if<GnssFix>(&m)) fixes.push_back(*p);
    if (const auto* p = std::get_if<Imu>(&m)) imu.push_back(*p);
    if (const auto* p = std::get_if<Heading>(&m)) headings.push_back(*p);
    if (const auto* p = std::get_if<LaserScan>(&m)) scans.push_back(*p);
  }
  ASSERT_EQ(odometry.size(), 4U);
  EXPECT_EQ(odometry[0].stamp.ns, 1001000000005);
  EXPECT_THAT(odometry[0].T_previous_now, poseNear(Pose2{0.5, 0.0, 0.0}, 1e-12, 1e-12));

  ASSERT_EQ(fixes.size(), 5U);
  EXPECT_EQ(fixes[0].type, GnssFixType::kNone);
  EXPECT_EQ(fixes[1].type, GnssFixType::kSingle);
  EXPECT_EQ(fixes[2].type, GnssFixType::kDifferential);
  ASSERT_TRUE(fixes[2].cov_enu);
  EXPECT_EQ((*fixes[2].cov_enu)(1, 1), 4.0);
  EXPECT_FALSE(fixes[3].cov_enu) << "covariance type 0 is unknown, not zero";
  EXPECT_TRUE(std::isfinite(std::get<Geodetic>(fixes[4].position).height_m));
  EXPECT_NEAR(reader->rig().p_base_antenna.x, -0.2, 1e-12);

  // An IMU mounted upside down, seen in base axes.
  ASSERT_EQ(imu.size(), 5U);
  EXPECT_NEAR(imu[0].omega_radps.z(), 0.2, 1e-9);
  EXPECT_NEAR(imu[0].accel_mps2.z(), 9.8, 1e-9);
  ASSERT_EQ(headings.size(), 4U) << "orientation_covariance[0] = -1 is no orientation";
  EXPECT_NEAR(headings[0].yaw_rad, 0.4, 1e-9);
  EXPECT_NEAR(headings[0].sigma_rad.value_or(-1.0), 0.2, 1e-12);

  // A laser hanging upside down: its rightmost beam is our leftmost.
  ASSERT_EQ(scans.size(), 5U);
  EXPECT_THAT(scans[0].T_base_laser, poseNear(Pose2{0.4, 0.0, 0.0}, 1e-9, 1e-9));
  EXPECT_NEAR(scans[0].angle_min_rad, -1.0, 1e-6);
  EXPECT_NEAR(scans[0].angle_step_rad, 0.5, 1e-6);
  EXPECT_FLOAT_EQ(scans[0].ranges_m[0], 5.0F);
  EXPECT_FALSE(scans[0].valid(2));
}

TEST(Bag, VelocitiesJoinTheFixOfTheirStamp) {
  const std::string path = (testFolder() / "v.bag").string();
  {
    rosbag::Bag bag(path, rosbag::bagmode::Write);
    for (int i = 0; i < 4; ++i) {
      const ros::Time t(1000 + static_cast<unsigned>(i), 5);
      sensor_msgs::NavSatFix fix;
      fix.header.stamp = t;
      fix.latitude = 42.0;
      geometry_msgs::TwistWithCovarianceStamped velocity;
      velocity.header.stamp = t;
      velocity.twist.twist.linear.x = 1.0 + i;
      velocity.twist.covariance[0] = velocity.twist.covariance[7] = 0.04;
      geometry_msgs::TwistStamped command;
      command.header.stamp = t;
      command.twist.linear.x = 99.0;
      bag.write("/robot/cmd_vel", t, command);
      if (i == 1) bag.write("/gps/fix_velocity", t, velocity);  // before its fix
      bag.write("/gps/fix", t, fix);
      if (i == 0 || i == 3) bag.write("/gps/fix_velocity", t, velocity);
      sensor_msgs::Imu imu;  // later: the third fix waits no longer
      imu.header.stamp = t + ros::Duration(0.5);
      imu.orientation_covariance[0] = -1.0;
      bag.write("/imu", imu.header.stamp, imu);
    }
  }
  const auto reader = openRecording(path, {});
  std::vector<GnssFix> fixes;
  std::vector<std::size_t> at;
  for (std::size_t n = 0; const auto record = reader->next(); ++n) {
    if (const auto* fix = std::get_if<GnssFix>(&record->measurement)) {
      fixes.push_back(*fix);
      at.push_back(n);
    }
  }
  ASSERT_EQ(fixes.size(), 4U);
  for (const std::size_t i : {0U, 1U, 3U}) {
    ASSERT_TRUE(fixes[i].velocity) << i;
    EXPECT_EQ(fixes[i].velocity->enu_mps.x(), 1.0 + static_cast<double>(i));
    EXPECT_NEAR(fixes[i].velocity->sigma_mps.value_or(0.0), 0.2, 1e-12);
  }
  EXPECT_FALSE(fixes[2].velocity);
  EXPECT_EQ(at, (std::vector<std::size_t>{0, 2, 4, 6}));
  EXPECT_THAT(reader->notes(), testing::Contains(HasSubstr("cmd_vel")));
}

TEST(Bag, AMagneticFieldGivesHeadingsUnlessAnOrientationHasIt) {
  for (const bool oriented : {false, true}) {
    const std::string path = (testFolder() / "m.bag").string();
    {
      rosbag::Bag bag(path, rosbag::bagmode::Write);
      for (int i = 0; i < 10; ++i) {
        const ros::Time t(1000 + static_cast<unsigned>(i), 5);
        sensor_msgs::Imu imu;
        imu.header.stamp = t;
        imu.orientation_covariance[0] = oriented ? 0.01 : -1.0;
        imu.orientation.w = 1.0;
        imu.linear_acceleration.z = 9.8;
        bag.write("/imu/data", t, imu);
        sensor_msgs::MagneticField field;  // north is to the left: the robot looks east
        field.header.stamp = t + ros::Duration(0.1);
        field.magnetic_field.y = (i == 7 ? 2.0 : 1.0) * 20e-6;
        field.magnetic_field.z = -40e-6;
        bag.write("/imu/mag", field.header.stamp, field);
      }
    }
    const auto reader = openRecording(path, {});
    std::size_t headings = 0;
    while (const auto record = reader->next()) {
      const auto* heading = std::get_if<Heading>(&record->measurement);
      if (heading == nullptr || record->source != "/imu/mag") continue;
      ++headings;
      EXPECT_NEAR(heading->yaw_rad, 0.0, 1e-9);
    }
    EXPECT_EQ(headings, oriented ? 0U : 9U);
    EXPECT_THAT(
        reader->notes(),
        testing::Contains(HasSubstr(oriented ? "the orientation of the IMU" : "steel")));
  }
}

TEST(Bag, BadInput) {
  const auto folder = testFolder();
  const std::string bytes = readFile(writeBag(folder / "a.bag"));
  EXPECT_THAT(inputError((folder / "none.bag").string()), HasSubstr("no such file"));
  EXPECT_THAT(inputError(writeFile(folder / "empty.bag", "")), HasSubstr("empty"));
  EXPECT_THAT(
      inputError(writeFile(folder / "garbage.bag", "no bag at all")), HasSubstr("not a ROS 1 bag"));
  EXPECT_THAT(
      inputError(writeFile(folder / "cut.bag", bytes.substr(0, bytes.size() / 2))),
      HasSubstr("damaged or cut off"));
  EXPECT_THAT(
      inputError(writeFile(folder / "head.bag", bytes.substr(0, 16))),
      HasSubstr("damaged or cut off"));
}

}  // namespace
}  // namespace vestibule::io
