#include "vestibule/io/recording.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "readers.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::io {
namespace {

enum class Format { kRawlog, kCarmen, kBag, kRos2Bag, kCsv };

constexpr std::string_view kBagMagic = "#ROSBAG V";
constexpr std::string_view kSqliteMagic = "SQLite format 3";

bool startsWith(std::string_view text, std::string_view prefix) {
  return text.substr(0, prefix.size()) == prefix;
}

bool hasExtension(const std::string& path, std::string_view extension) {
  std::filesystem::path p(path);
  if (p.extension() == ".gz" || p.extension() == ".bz2") p = p.stem();
  return p.extension() == extension;
}

std::string readHead(ByteStream& stream) {
  std::string head(4096, '\0');
  std::size_t n = 0;
  while (n < head.size()) {
    const std::size_t got = stream.read(head.data() + n, head.size() - n);
    if (got == 0) break;
    n += got;
  }
  head.resize(n);
  stream.rewind();
  return head;
}

Format formatOf(const std::string& path, std::string_view head) {
  if (startsWith(head, kBagMagic)) return Format::kBag;
  if (startsWith(head, kSqliteMagic)) return Format::kRos2Bag;
  if (looksLikeRawlog(head)) return Format::kRawlog;
  if (hasExtension(path, ".csv")) return Format::kCsv;
  if (looksLikeCarmen(head)) return Format::kCarmen;
  // The name says what it should have been: a better message than "unknown format".
  constexpr std::array<std::pair<std::string_view, std::string_view>, 5> kExpected{{
      {".rawlog", "an MRPT rawlog (no MRPT object at its start)"},
      {".bag", "a ROS 1 bag (no '#ROSBAG V2.0' at its start)"},
      {".db3", "a ROS 2 bag (no 'SQLite format 3' at its start)"},
      {".log", "a CARMEN log (its first line has no keyword such as FLASER or ODOM)"},
      {".clf", "a CARMEN log (its first line has no keyword such as FLASER or ODOM)"},
  }};
  for (const auto& [extension, what] : kExpected) {
    if (hasExtension(path, extension)) {
      throw InputError(
          path + ": not " + std::string(what) + "; starts with " + quoted(head.substr(0, 24)) +
          "; the file is damaged or has the wrong name");
    }
  }
  throw InputError(
      path + ": unknown format, starts with " + quoted(head.substr(0, 24)) +
      "; readable are MRPT .rawlog, CARMEN .log/.clf, ROS 1 .bag, ROS 2 .db3 and .csv");
}

std::vector<std::string> mappingFiles(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".yaml") files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

Eigen::Matrix3d imuMounting(const SensorRig& rig) {
  const double c = std::cos(rig.imu_yaw_rad);
  const double s = std::sin(rig.imu_yaw_rad);
  Eigen::Matrix3d R;
  R << c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0;
  // Upside down: half a turn about the IMU's own x axis.
  return R * Eigen::Vector3d(1.0, rig.imu_sign_z, rig.imu_sign_z).asDiagonal();
}

CsvMapping chooseCsvMapping(const std::string& path, const RecordingOptions& options) {
  if (!options.csv_mapping.empty()) return loadParams<CsvMapping>(options.csv_mapping);
  LineReader lines(openFile(path));
  std::string_view header;
  lines.next(header);
  for (const std::string& file : mappingFiles(options.csv_mapping_dir)) {
    CsvMapping mapping = loadParams<CsvMapping>(file);
    const auto names = splitCsvRow(header, mapping.delimiter);
    const auto wanted = mapping.columns();
    const bool fits = std::all_of(wanted.begin(), wanted.end(), [&](const std::string& column) {
      return std::find(names.begin(), names.end(), column) != names.end();
    });
    if (fits) return mapping;
  }
  throw InputError(
      path + ":1: no column mapping fits the header " + quoted(header, 400) +
      "; write a YAML that names its columns (time: {column: ...}, gnss, wheels, heading; "
      "config/csv/ has examples) and pass it with --csv-mapping");
}

std::unique_ptr<RecordingReader> openRecording(
    const std::string& path, const RecordingOptions& asked) {
  RecordingOptions options = asked;
  if (!options.correct_headings) options.rig.compass = {};
  auto stream = openFile(path);
  switch (formatOf(path, readHead(*stream))) {
    case Format::kRawlog:
      return openRawlog(std::move(stream), options);
    case Format::kCarmen:
      return openCarmen(std::move(stream), options);
    case Format::kBag:
      return openBag(path, options);
    case Format::kRos2Bag:
      return openRos2Bag(path, options);
    case Format::kCsv:
      break;
  }
  CsvMapping mapping = chooseCsvMapping(path, options);
  if (!options.correct_headings && mapping.heading) mapping.heading->compass = {};
  return openCsv(std::move(stream), mapping, options.rig);
}

std::optional<Trajectory> readReference(const std::string& path, const RecordingOptions& options) {
  auto stream = openFile(path);
  if (formatOf(path, readHead(*stream)) != Format::kCsv) return std::nullopt;
  return readCsvReference(std::move(stream), chooseCsvMapping(path, options));
}

}  // namespace vestibule::io
