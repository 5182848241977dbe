#include "targets.hpp"

#include "cdr.hpp"
#include "map_yaml.hpp"
#include "pgm.hpp"
#include "readers.hpp"
#include "vestibule/core/errors.hpp"
#include "wean_map.hpp"

namespace vestibule::io::fuzz {
namespace {

constexpr const char* kMapping = R"(
time: {column: t, unit_s: 1.0e-6}
gnss:
  - {name: geodetic, lat: lat, lon: lon, height: h, delay_s: 0.5}
  - {name: local, x: lat, y: lon, axes: north_east, repeats_are_stale: true}
wheels: {left: vl, right: vr, track_m: 0.5}
heading: {column: yaw, clockwise_from_north: true}
yaw_rate: {from_heading: true}
reference: {x: lat, y: lon, yaw: yaw}
)";

template <class Function>
void survive(const Function& function) {
  try {
    function();
  } catch (const InputError&) {
  } catch (const ConfigError&) {
  }
}

void drain(RecordingReader& reader) {
  while (reader.next()) {
  }
  (void)reader.notes();
}

}  // namespace

void readCarmen(const std::string& bytes) {
  survive([&] {
    (void)looksLikeCarmen(bytes);
    drain(*openCarmen(openMemory(bytes, "fuzz.log"), {}));
  });
}

void readCsv(const std::string& bytes) {
  static const auto mapping = parseParams<CsvMapping>(kMapping, "mapping");
  survive([&] { drain(*openCsv(openMemory(bytes, "fuzz.csv"), mapping, {})); });
  survive([&] { (void)readCsvReference(openMemory(bytes, "fuzz.csv"), mapping); });
  survive([&] { (void)parseParams<CsvMapping>(bytes, "fuzz.yaml"); });
}

void readPgm(const std::string& bytes) {
  if (looksLikePgm(bytes)) survive([&] { (void)decodePgm(bytes, "fuzz.pgm"); });
}

void readMapYaml(const std::string& bytes) {
  survive([&] { (void)parseMapYaml(bytes, "fuzz.yaml"); });
}

namespace {

template <class Message>
void decodeAs(const std::string& bytes) {
  try {
    Message message;
    decodeCdr(bytes, message);
  } catch (const std::runtime_error&) {
  }
}

}  // namespace

void readCdr(const std::string& bytes) {
  decodeAs<sensor_msgs::NavSatFix>(bytes);
  decodeAs<sensor_msgs::Imu>(bytes);
  decodeAs<nav_msgs::Odometry>(bytes);
  decodeAs<sensor_msgs::LaserScan>(bytes);
  decodeAs<sensor_msgs::MagneticField>(bytes);
  decodeAs<geometry_msgs::TwistStamped>(bytes);
  decodeAs<geometry_msgs::TwistWithCovarianceStamped>(bytes);
  decodeAs<tf2_msgs::TFMessage>(bytes);
}

void readWeanMapBytes(const std::string& bytes) {
  survive([&] { (void)readWeanMap(openMemory(bytes, "fuzz.dat")); });
}

}  // namespace vestibule::io::fuzz
