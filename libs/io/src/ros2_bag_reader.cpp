#include <sqlite3.h>

#include <memory>
#include <set>

#include "cdr.hpp"
#include "ros_messages.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::io {
namespace {

enum class Kind {
  kOther,
  kFix,
  kImu,
  kMagneticField,
  kOdometry,
  kScan,
  kVelocity,
  kVelocityWithCovariance,
  kStaticFrames
};

struct Topic {
  std::string name;
  std::string type;
  Kind kind = Kind::kOther;
};

Kind kindOf(const std::string& name, const std::string& type) {
  if (type == "sensor_msgs/msg/NavSatFix") return Kind::kFix;
  if (type == "sensor_msgs/msg/Imu") return Kind::kImu;
  if (type == "nav_msgs/msg/Odometry") return Kind::kOdometry;
  if (type == "sensor_msgs/msg/LaserScan") return Kind::kScan;
  if (type == "sensor_msgs/msg/MagneticField") return Kind::kMagneticField;
  if (isGnssVelocity(name)) {
    if (type == "geometry_msgs/msg/TwistStamped") return Kind::kVelocity;
    if (type == "geometry_msgs/msg/TwistWithCovarianceStamped") {
      return Kind::kVelocityWithCovariance;
    }
  }
  const bool is_tf = type == "tf2_msgs/msg/TFMessage";
  return is_tf && frameName(name) == "tf_static" ? Kind::kStaticFrames : Kind::kOther;
}

struct CloseDatabase {
  void operator()(sqlite3* db) const { sqlite3_close(db); }
};
struct CloseStatement {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Statement = std::unique_ptr<sqlite3_stmt, CloseStatement>;

/// A bag of rosbag2 in its sqlite3 storage: tables `topics` and `messages`.
class Ros2BagReader : public RecordingReader {
 public:
  Ros2BagReader(const std::string& path, const RecordingOptions& options)
      : path_(path), messages_(options.rig) {
    sqlite3* db = nullptr;
    // Immutable: nothing is locked or created beside a file in a folder that cannot be written.
    const std::string uri = "file:" + percentEncoded(path) + "?mode=ro&immutable=1";
    const int result =
        sqlite3_open_v2(uri.c_str(), &db, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
    db_.reset(db);
    if (result != SQLITE_OK) fail(sqlite3_errmsg(db));
    readTopics();
    readStaticFrames();
    size_ = count();
    messages_of_bag_ = prepare("SELECT id, topic_id, data FROM messages ORDER BY timestamp, id");
  }

  std::optional<Record> next() override {
    while (true) {
      if (auto record = messages_.next()) return record;
      // A statement that has ended begins anew when it is asked again.
      if (ended_ || !step(messages_of_bag_)) {
        ended_ = true;
        messages_.finish();
        return messages_.next();
      }
      ++number_;
      take(topicOf(sqlite3_column_int64(messages_of_bag_.get(), 1)));
    }
  }
  [[nodiscard]] double progress() const override {
    return size_ > 0 ? static_cast<double>(number_) / static_cast<double>(size_) : 1.0;
  }
  [[nodiscard]] std::vector<std::string> notes() const override {
    std::vector<std::string> texts = messages_.notes();
    for (const auto& [id, topic] : topics_) {
      if (topic.kind != Kind::kOther) continue;
      texts.push_back("topic " + topic.name + " (" + topic.type + ") ignored");
    }
    return texts;
  }
  [[nodiscard]] std::string format() const override { return "ROS 2 bag"; }
  [[nodiscard]] const SensorRig& rig() const override { return messages_.rig(); }

 private:
  static std::string percentEncoded(const std::string& path) {
    std::string encoded;
    for (const char c : path) {
      if (c == '%' || c == '?' || c == '#') {
        char hex[4];
        std::snprintf(hex, sizeof hex, "%%%02X", static_cast<unsigned>(c));
        encoded += hex;
      } else {
        encoded += c;
      }
    }
    return encoded;
  }

  [[noreturn]] void fail(const std::string& reason) const {
    throw InputError(
        path_ + ": " + (number_ > 0 ? "message " + std::to_string(number_) + ": " : "") +
        "the ROS 2 bag is damaged or cut off (" + reason + "); get another copy of it");
  }

  [[nodiscard]] Statement prepare(const char* sql) const {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(db_.get(), sql, -1, &statement, nullptr) != SQLITE_OK) {
      fail(sqlite3_errmsg(db_.get()));
    }
    return Statement(statement);
  }
  /// False after the last row.
  [[nodiscard]] bool step(const Statement& statement) const {
    const int result = sqlite3_step(statement.get());
    if (result != SQLITE_ROW && result != SQLITE_DONE) fail(sqlite3_errmsg(db_.get()));
    return result == SQLITE_ROW;
  }
  [[nodiscard]] static std::string textAt(const Statement& statement, int column) {
    const unsigned char* text = sqlite3_column_text(statement.get(), column);
    return text == nullptr ? std::string() : reinterpret_cast<const char*>(text);
  }
  [[nodiscard]] static std::string_view blobAt(const Statement& statement, int column) {
    const void* data = sqlite3_column_blob(statement.get(), column);
    const int size = sqlite3_column_bytes(statement.get(), column);
    if (data == nullptr) return {};
    return {static_cast<const char*>(data), static_cast<std::size_t>(size)};
  }

  void readTopics() {
    const Statement statement = prepare("SELECT id, name, type, serialization_format FROM topics");
    bool any = false;
    while (step(statement)) {
      Topic topic{textAt(statement, 1), textAt(statement, 2), Kind::kOther};
      topic.kind = kindOf(topic.name, topic.type);
      const std::string coding = textAt(statement, 3);
      if (topic.kind != Kind::kOther && coding != "cdr") {
        throw InputError(
            path_ + ": topic " + topic.name + " is coded as " + io::quoted(coding) +
            ", not as cdr; record the bag with the default serialization format");
      }
      if (topic.kind == Kind::kVelocity || topic.kind == Kind::kVelocityWithCovariance) {
        messages_.expectVelocities();
      }
      any = any || (topic.kind != Kind::kOther && topic.kind != Kind::kStaticFrames);
      topics_[sqlite3_column_int64(statement.get(), 0)] = topic;
    }
    if (!any) {
      throw InputError(
          path_ +
          ": no NavSatFix, Imu, Odometry or LaserScan topic in this bag; "
          "record at least one of them");
    }
  }

  [[nodiscard]] const Topic& topicOf(sqlite3_int64 id) const {
    const auto it = topics_.find(id);
    if (it == topics_.end()) fail("a message of the unknown topic " + std::to_string(id));
    return it->second;
  }

  /// Static transforms late in the file still hold from the start.
  void readStaticFrames() {
    const Statement statement = prepare("SELECT topic_id, data FROM messages ORDER BY id");
    while (step(statement)) {
      if (topicOf(sqlite3_column_int64(statement.get(), 0)).kind != Kind::kStaticFrames) continue;
      tf2_msgs::TFMessage tf;
      decode(blobAt(statement, 1), tf, "/tf_static");
      for (const auto& transform : tf.transforms) messages_.frames().add(transform);
    }
  }

  [[nodiscard]] std::size_t count() const {
    const Statement statement = prepare("SELECT count(*) FROM messages");
    return step(statement) ? static_cast<std::size_t>(sqlite3_column_int64(statement.get(), 0)) : 0;
  }

  template <class T>
  void decode(std::string_view bytes, T& message, const std::string& topic) const {
    try {
      decodeCdr(bytes, message);
    } catch (const std::runtime_error& e) {
      fail(topic + ": " + e.what());
    }
  }

  template <class T>
  void decodeAndTake(const std::string& topic) {
    T message;
    decode(blobAt(messages_of_bag_, 2), message, topic);
    messages_.take(number_, topic, message);
  }

  void take(const Topic& topic) {
    switch (topic.kind) {
      case Kind::kFix:
        return decodeAndTake<sensor_msgs::NavSatFix>(topic.name);
      case Kind::kImu:
        return decodeAndTake<sensor_msgs::Imu>(topic.name);
      case Kind::kOdometry:
        return decodeAndTake<nav_msgs::Odometry>(topic.name);
      case Kind::kScan:
        return decodeAndTake<sensor_msgs::LaserScan>(topic.name);
      case Kind::kMagneticField:
        return decodeAndTake<sensor_msgs::MagneticField>(topic.name);
      case Kind::kVelocity:
        return decodeAndTake<geometry_msgs::TwistStamped>(topic.name);
      case Kind::kVelocityWithCovariance:
        return decodeAndTake<geometry_msgs::TwistWithCovarianceStamped>(topic.name);
      case Kind::kStaticFrames:
      case Kind::kOther:
        break;
    }
  }

  std::string path_;
  std::unique_ptr<sqlite3, CloseDatabase> db_;
  std::map<sqlite3_int64, Topic> topics_;
  Statement messages_of_bag_;
  std::size_t size_ = 0;
  std::size_t number_ = 0;
  bool ended_ = false;
  RosMessages messages_;
};

}  // namespace

std::unique_ptr<RecordingReader> openRos2Bag(
    const std::string& path, const RecordingOptions& options) {
  return std::make_unique<Ros2BagReader>(path, options);
}

}  // namespace vestibule::io
