#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <tf2_msgs/TFMessage.h>

#include <set>

#include "ros_messages.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::io {
namespace {

bool readable(const rosbag::ConnectionInfo& c) {
  static const std::set<std::string> kTypes = {
      "sensor_msgs/NavSatFix",
      "sensor_msgs/Imu",
      "sensor_msgs/MagneticField",
      "nav_msgs/Odometry",
      "sensor_msgs/LaserScan"};
  const bool twist = c.datatype == "geometry_msgs/TwistStamped" ||
                     c.datatype == "geometry_msgs/TwistWithCovarianceStamped";
  return kTypes.count(c.datatype) > 0 || (twist && isGnssVelocity(c.topic));
}

class BagReader : public RecordingReader {
 public:
  BagReader(const std::string& path, const RecordingOptions& options)
      : path_(path), messages_(options.rig) {
    try {
      bag_.open(path, rosbag::bagmode::Read);
      readStaticFrames();
      view_.addQuery(bag_, [](const rosbag::ConnectionInfo* c) { return readable(*c); });
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
    while (true) {
      if (auto record = messages_.next()) return record;
      try {
        if (it_ == view_.end()) {
          messages_.finish();
          return messages_.next();
        }
        ++number_;
        take(*it_);
        ++it_;
      } catch (const InputError&) {
        throw;
      } catch (const std::exception& e) {
        fail(e);
      }
    }
  }
  [[nodiscard]] double progress() const override {
    return static_cast<double>(number_) / static_cast<double>(size_);
  }
  [[nodiscard]] std::vector<std::string> notes() const override {
    std::vector<std::string> texts = messages_.notes();
    texts.insert(texts.end(), topic_notes_.begin(), topic_notes_.end());
    return texts;
  }
  [[nodiscard]] std::string format() const override { return "ROS 1 bag"; }
  [[nodiscard]] const SensorRig& rig() const override { return messages_.rig(); }

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
      for (const auto& transform : tf->transforms) messages_.frames().add(transform);
    }
  }

  void noteOtherTopics() {
    rosbag::View all(bag_);
    std::set<std::string> texts;
    std::set<std::string> odometry;
    for (const auto* c : view_.getConnections()) {
      if (c->datatype == "nav_msgs/Odometry") odometry.insert(c->topic);
      if (c->datatype.rfind("geometry_msgs/", 0) == 0) messages_.expectVelocities();
    }
    for (const auto* c : all.getConnections()) {
      if (!readable(*c) && frameName(c->topic) != "tf_static")
        texts.insert("topic " + c->topic + " (" + c->datatype + ") ignored");
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
      messages_.take(number_, message.getTopic(), instantiate<sensor_msgs::NavSatFix>(message));
    } else if (type == "sensor_msgs/Imu") {
      messages_.take(number_, message.getTopic(), instantiate<sensor_msgs::Imu>(message));
    } else if (type == "nav_msgs/Odometry") {
      messages_.take(number_, message.getTopic(), instantiate<nav_msgs::Odometry>(message));
    } else if (type == "sensor_msgs/MagneticField") {
      messages_.take(number_, message.getTopic(), instantiate<sensor_msgs::MagneticField>(message));
    } else if (type == "geometry_msgs/TwistStamped") {
      messages_.take(
          number_, message.getTopic(), instantiate<geometry_msgs::TwistStamped>(message));
    } else if (type == "geometry_msgs/TwistWithCovarianceStamped") {
      messages_.take(
          number_,
          message.getTopic(),
          instantiate<geometry_msgs::TwistWithCovarianceStamped>(message));
    } else {
      messages_.take(number_, message.getTopic(), instantiate<sensor_msgs::LaserScan>(message));
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

  std::string path_;
  rosbag::Bag bag_;
  rosbag::View view_;
  rosbag::View::iterator it_;
  std::size_t size_ = 0;
  std::size_t number_ = 0;
  RosMessages messages_;
  std::vector<std::string> topic_notes_;
};

}  // namespace

std::unique_ptr<RecordingReader> openBag(const std::string& path, const RecordingOptions& options) {
  return std::make_unique<BagReader>(path, options);
}

}  // namespace vestibule::io
