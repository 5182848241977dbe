#include "cdr.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <stdexcept>

namespace vestibule::io {
namespace {

constexpr std::size_t kHeaderSize = 4;  // two bytes of representation, two of options

/// Values in order, each aligned to its size counted from after the header.
class CdrReader {
 public:
  explicit CdrReader(std::string_view bytes) {
    if (bytes.size() < kHeaderSize) throw std::runtime_error("no CDR header");
    if (bytes[0] != 0 || (bytes[1] != 0 && bytes[1] != 1)) {
      throw std::runtime_error("not plain CDR");
    }
    little_endian_ = bytes[1] == 1;
    body_ = bytes.substr(kHeaderSize);
  }

  template <class T>
  T number() {
    align(sizeof(T));
    char raw[sizeof(T)];
    std::memcpy(raw, take(sizeof(T)).data(), sizeof(T));
    if (!little_endian_) std::reverse(raw, raw + sizeof(T));
    T value;
    std::memcpy(&value, raw, sizeof(T));
    return value;
  }
  template <class T>
  void number(T& value) {
    value = number<T>();
  }
  std::string text() {
    const auto size = number<std::uint32_t>();  // with the closing zero
    const std::string_view raw = take(size);
    return std::string(raw.substr(0, size > 0 ? size - 1 : 0));
  }
  /// Number of elements that follow, each of at least `min_size` bytes.
  std::size_t count(std::size_t min_size) {
    const auto n = number<std::uint32_t>();
    if (n > (body_.size() - at_) / min_size) {
      throw std::runtime_error(
          "a list of " + std::to_string(n) + " elements does not fit into the message");
    }
    return n;
  }
  template <class Array>
  void fixed(Array& values) {
    for (auto& value : values) number(value);
  }

  void header(std_msgs::Header& header) {
    const auto seconds = number<std::int32_t>();
    const auto nanoseconds = number<std::uint32_t>();
    if (seconds < 0 || nanoseconds >= 1000000000U) {
      throw std::runtime_error("a stamp that is no time");
    }
    header.stamp.sec = static_cast<std::uint32_t>(seconds);
    header.stamp.nsec = nanoseconds;
    header.frame_id = text();
  }
  template <class Vector>
  void vector(Vector& v) {
    number(v.x);
    number(v.y);
    number(v.z);
  }
  void quaternion(geometry_msgs::Quaternion& q) {
    number(q.x);
    number(q.y);
    number(q.z);
    number(q.w);
  }

 private:
  void align(std::size_t size) { at_ = (at_ + size - 1) / size * size; }
  std::string_view take(std::size_t size) {
    if (at_ > body_.size() || size > body_.size() - at_) {
      throw std::runtime_error("it ends too early");
    }
    const std::string_view bytes = body_.substr(at_, size);
    at_ += size;
    return bytes;
  }

  bool little_endian_ = true;
  std::string_view body_;
  std::size_t at_ = 0;
};

}  // namespace

void decodeCdr(std::string_view bytes, sensor_msgs::NavSatFix& m) {
  CdrReader cdr(bytes);
  cdr.header(m.header);
  cdr.number(m.status.status);
  cdr.number(m.status.service);
  cdr.number(m.latitude);
  cdr.number(m.longitude);
  cdr.number(m.altitude);
  cdr.fixed(m.position_covariance);
  cdr.number(m.position_covariance_type);
}

void decodeCdr(std::string_view bytes, sensor_msgs::Imu& m) {
  CdrReader cdr(bytes);
  cdr.header(m.header);
  cdr.quaternion(m.orientation);
  cdr.fixed(m.orientation_covariance);
  cdr.vector(m.angular_velocity);
  cdr.fixed(m.angular_velocity_covariance);
  cdr.vector(m.linear_acceleration);
  cdr.fixed(m.linear_acceleration_covariance);
}

void decodeCdr(std::string_view bytes, nav_msgs::Odometry& m) {
  CdrReader cdr(bytes);
  cdr.header(m.header);
  m.child_frame_id = cdr.text();
  cdr.vector(m.pose.pose.position);
  cdr.quaternion(m.pose.pose.orientation);
  cdr.fixed(m.pose.covariance);
  cdr.vector(m.twist.twist.linear);
  cdr.vector(m.twist.twist.angular);
  cdr.fixed(m.twist.covariance);
}

void decodeCdr(std::string_view bytes, sensor_msgs::LaserScan& m) {
  CdrReader cdr(bytes);
  cdr.header(m.header);
  cdr.number(m.angle_min);
  cdr.number(m.angle_max);
  cdr.number(m.angle_increment);
  cdr.number(m.time_increment);
  cdr.number(m.scan_time);
  cdr.number(m.range_min);
  cdr.number(m.range_max);
  m.ranges.resize(cdr.count(sizeof(float)));
  cdr.fixed(m.ranges);
  m.intensities.resize(cdr.count(sizeof(float)));
  cdr.fixed(m.intensities);
}

void decodeCdr(std::string_view bytes, sensor_msgs::MagneticField& m) {
  CdrReader cdr(bytes);
  cdr.header(m.header);
  cdr.vector(m.magnetic_field);
  cdr.fixed(m.magnetic_field_covariance);
}

void decodeCdr(std::string_view bytes, geometry_msgs::TwistStamped& m) {
  CdrReader cdr(bytes);
  cdr.header(m.header);
  cdr.vector(m.twist.linear);
  cdr.vector(m.twist.angular);
}

void decodeCdr(std::string_view bytes, geometry_msgs::TwistWithCovarianceStamped& m) {
  CdrReader cdr(bytes);
  cdr.header(m.header);
  cdr.vector(m.twist.twist.linear);
  cdr.vector(m.twist.twist.angular);
  cdr.fixed(m.twist.covariance);
}

void decodeCdr(std::string_view bytes, tf2_msgs::TFMessage& m) {
  CdrReader cdr(bytes);
  constexpr std::size_t kSmallest = 8 + 4 + 4 + 7 * sizeof(double);
  m.transforms.resize(cdr.count(kSmallest));
  for (auto& t : m.transforms) {
    cdr.header(t.header);
    t.child_frame_id = cdr.text();
    cdr.vector(t.transform.translation);
    cdr.quaternion(t.transform.rotation);
  }
}

}  // namespace vestibule::io
