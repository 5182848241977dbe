#include <gmock/gmock.h>
#include <sqlite3.h>

#include <cmath>
#include <cstring>

#include "cdr.hpp"
#include "matchers.hpp"
#include "temp_files.hpp"

namespace vestibule::io {
namespace {

using testing::HasSubstr;

/// Writes what CDR readers read.
class CdrWriter {
 public:
  template <class T>
  CdrWriter& number(T value) {
    while (body_.size() % sizeof(T) != 0) body_ += '\0';
    char raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    body_.append(raw, sizeof(T));
    return *this;
  }
  CdrWriter& text(const std::string& t) {
    number(static_cast<std::uint32_t>(t.size() + 1));
    body_ += t + '\0';
    return *this;
  }
  CdrWriter& header(std::int32_t seconds, const std::string& frame) {
    return number(seconds).number(std::uint32_t{5}).text(frame);
  }
  CdrWriter& doubles(std::initializer_list<double> values) {
    for (const double v : values) number(v);
    return *this;
  }
  CdrWriter& zeros(int n) {
    for (int i = 0; i < n; ++i) number(0.0);
    return *this;
  }
  [[nodiscard]] std::string bytes() const { return std::string("\0\1\0\0", 4) + body_; }

 private:
  std::string body_;
};

std::string odometry(int second) {
  CdrWriter w;
  w.header(1000 + second, "odom").text("base_link");
  w.doubles({0.5 * second, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0}).zeros(36).zeros(6).zeros(36);
  return w.bytes();
}

std::string scan(int second) {
  CdrWriter w;
  w.header(1000 + second, "laser");
  for (const float v : {-1.0F, 1.0F, 0.5F, 0.0F, 0.1F, 0.1F, 10.0F}) w.number(v);
  w.number(std::uint32_t{5});
  for (const float v : {1.0F, 2.0F, INFINITY, 4.0F, 5.0F}) w.number(v);
  w.number(std::uint32_t{0});
  return w.bytes();
}

std::string staticFrames() {
  CdrWriter w;
  w.number(std::uint32_t{2});
  w.header(1, "base_link").text("mast").doubles({0.3, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0});
  // Turned by a quarter to the left.
  const double h = std::sqrt(0.5);
  w.header(1, "mast").text("laser").doubles({0.1, 0.0, 0.0, 0.0, 0.0, h, h});
  return w.bytes();
}

std::string fix(int second) {
  CdrWriter w;
  w.header(1000 + second, "gps").number(std::int8_t{0}).number(std::uint16_t{1});
  w.doubles({42.0, -71.0, 20.0}).zeros(9).number(std::uint8_t{0});
  return w.bytes();
}

std::string velocity(int second) {
  CdrWriter w;
  w.header(1000 + second, "gps").doubles({0.3, -0.4, 0.1}).zeros(3);
  return w.bytes();
}

struct Message {
  int topic;
  int timestamp;
  std::string data;
};

std::string writeBag(
    const std::filesystem::path& path,
    const std::vector<Message>& messages,
    const std::string& coding = "cdr") {
  std::filesystem::remove(path);
  sqlite3* db = nullptr;
  EXPECT_EQ(sqlite3_open(path.c_str(), &db), SQLITE_OK);
  const std::string schema =
      "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
      " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
      " timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
      "INSERT INTO topics VALUES(1, '/odom', 'nav_msgs/msg/Odometry', '" +
      coding +
      "', '');"
      "INSERT INTO topics VALUES(2, '/scan', 'sensor_msgs/msg/LaserScan', 'cdr', '');"
      "INSERT INTO topics VALUES(3, '/tf_static', 'tf2_msgs/msg/TFMessage', 'cdr', '');"
      "INSERT INTO topics VALUES(4, '/cmd_vel', 'geometry_msgs/msg/Twist', 'cdr', '');"
      "INSERT INTO topics VALUES(5, '/fix', 'sensor_msgs/msg/NavSatFix', 'cdr', '');"
      "INSERT INTO topics VALUES(6, '/vel', 'geometry_msgs/msg/TwistStamped', 'cdr', '');";
  EXPECT_EQ(sqlite3_exec(db, schema.c_str(), nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_stmt* insert = nullptr;
  sqlite3_prepare_v2(
      db, "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", -1, &insert, nullptr);
  for (const Message& m : messages) {
    sqlite3_bind_int(insert, 1, m.topic);
    sqlite3_bind_int(insert, 2, m.timestamp);
    sqlite3_bind_blob(insert, 3, m.data.data(), static_cast<int>(m.data.size()), SQLITE_TRANSIENT);
    EXPECT_EQ(sqlite3_step(insert), SQLITE_DONE);
    sqlite3_reset(insert);
  }
  sqlite3_finalize(insert);
  sqlite3_close(db);
  return path.string();
}

std::vector<Message> drive() {
  // Written out of order; static frames last.
  return {
      {2, 11, scan(1)},
      {1, 10, odometry(0)},
      {1, 12, odometry(1)},
      {4, 13, "whatever"},
      {3, 14, staticFrames()}};
}

TEST(Ros2Bag, MessagesBecomeMeasurementsInOrderOfTime) {
  const auto reader = openRecording(writeBag(testFolder() / "a.db3", drive()), {});
  std::vector<Record> records;
  while (auto record = reader->next()) records.push_back(*record);
  ASSERT_EQ(records.size(), 2U);
  const auto& s = std::get<LaserScan>(records[0].measurement);
  EXPECT_EQ(s.stamp.ns, 1001000000005);
  ASSERT_EQ(s.ranges_m.size(), 5U);
  EXPECT_FLOAT_EQ(s.ranges_m[3], 4.0F);
  EXPECT_NEAR(s.angle_step_rad, 0.5, 1e-6);
  EXPECT_THAT(s.T_base_laser, poseNear(Pose2{0.4, 0.0, 1.5707963268}, 1e-9, 1e-9));
  const auto& o = std::get<WheelOdometry>(records[1].measurement);
  EXPECT_THAT(o.T_previous_now, poseNear(Pose2{0.5, 0.0, 0.0}, 1e-12, 1e-12));
  EXPECT_NEAR(o.dt_s, 1.0, 1e-9);
  EXPECT_EQ(reader->format(), "ROS 2 bag");
  EXPECT_THAT(reader->notes(), testing::Contains(HasSubstr("/cmd_vel")));
  EXPECT_DOUBLE_EQ(reader->progress(), 1.0);
}

TEST(Ros2Bag, VelocitiesJoinTheFixOfTheirStamp) {
  const std::vector<Message> messages = {{5, 10, fix(1)}, {6, 11, velocity(1)}, {5, 12, fix(2)}};
  const auto reader = openRecording(writeBag(testFolder() / "v.db3", messages), {});
  const auto first = reader->next();
  const auto last = reader->next();
  ASSERT_TRUE(first && last);
  const auto& joined = std::get<GnssFix>(first->measurement).velocity;
  ASSERT_TRUE(joined);
  EXPECT_EQ(joined->enu_mps, Eigen::Vector3d(0.3, -0.4, 0.1));
  EXPECT_FALSE(std::get<GnssFix>(last->measurement).velocity);
  EXPECT_FALSE(reader->next());
}

TEST(Ros2Bag, BadInput) {
  const auto folder = testFolder();
  const auto with = [&](std::size_t index, const std::string& data) {
    auto messages = drive();
    messages[index].data = data;
    return inputError(writeBag(folder / "b.db3", messages));
  };
  EXPECT_THAT(with(0, scan(1).substr(0, 40)), HasSubstr("/scan: it ends too early"));
  EXPECT_THAT(with(2, ""), HasSubstr("message 3: "));
  EXPECT_THAT(with(1, "\x05\x05\x05\x05"), HasSubstr("/odom: not plain CDR"));
  EXPECT_THAT(with(4, staticFrames().substr(0, 50)), HasSubstr("/tf_static: "));
  // A count that does not fit: 28 bytes of numbers behind stamp and frame.
  std::string wrong_count = scan(1);
  wrong_count[4 + 20 + 28] = '\x7f';
  EXPECT_THAT(with(0, wrong_count), HasSubstr("does not fit into the message"));

  auto messages = drive();
  messages[0].topic = 77;
  EXPECT_THAT(
      inputError(writeBag(folder / "t.db3", messages)), HasSubstr("of the unknown topic 77"));
  EXPECT_THAT(
      inputError(writeBag(folder / "c.db3", drive(), "json")), HasSubstr("coded as 'json'"));

  const std::string bytes = readFile(writeBag(folder / "a.db3", drive()));
  EXPECT_THAT(
      inputError(writeFile(folder / "cut.db3", bytes.substr(0, bytes.size() / 2))),
      HasSubstr("damaged or cut off"));
  EXPECT_THAT(
      inputError(writeFile(folder / "head.db3", bytes.substr(0, 100))),
      HasSubstr("damaged or cut off"));
  EXPECT_THAT(inputError(writeFile(folder / "x.db3", "no bag")), HasSubstr("not a ROS 2 bag"));
}

TEST(Cdr, KnowsBothByteOrders) {
  sensor_msgs::LaserScan little;
  decodeCdr(
      readFile(std::string(VESTIBULE_SOURCE_DIR) + "/libs/io/fuzz/corpus/cdr/scan.bin"), little);
  sensor_msgs::LaserScan big;
  decodeCdr(
      readFile(std::string(VESTIBULE_SOURCE_DIR) + "/libs/io/fuzz/corpus/cdr/scan_big_endian.bin"),
      big);
  EXPECT_EQ(little.header.frame_id, "laser");
  EXPECT_EQ(big.header.stamp.sec, 5U);
  EXPECT_FLOAT_EQ(big.range_max, little.range_max);
  EXPECT_EQ(little.ranges.size(), 5U);
  EXPECT_EQ(big.ranges.size(), 2U);
}

}  // namespace
}  // namespace vestibule::io
