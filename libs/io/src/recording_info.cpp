#include "vestibule/io/recording_info.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "vestibule/core/angles.hpp"

namespace vestibule::io {
namespace {

constexpr double kMaxJump_m = 5.0;       // an odometry increment beyond this is a reset or a fault
constexpr double kMaxRate_radps = 20.0;  // no ground robot turns faster
constexpr std::size_t kProgressStep = 512;
constexpr std::size_t kMinForConstant = 10;
constexpr double kManyBeams = 0.5;

std::string fixed(double value, int decimals) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

std::string_view kindOf(const Measurement& m) {
  static constexpr std::string_view kKinds[] = {"odometry", "imu", "heading", "gnss", "laser"};
  return kKinds[m.index()];
}

/// Everything gathered of one source while reading.
class SourceProbe {
 public:
  SourceProbe(std::string source, std::string_view kind) {
    info_.source = std::move(source);
    info_.kind = kind;
  }

  void take(const Record& record) {
    const Timestamp stamp = stampOf(record.measurement);
    if (info_.count == 0) {
      info_.first = stamp;
    } else {
      const double dt_s = toSeconds(stamp - info_.last);
      if (dt_s < 0.0) {
        ++info_.backward_stamps;
        find("stamps run backwards", record.number);
      } else if (dt_s == 0.0) {
        find("stamps equal to the one before", record.number);
      } else {
        intervals_s_.push_back(static_cast<float>(dt_s));
        info_.largest_gap_s = std::max(info_.largest_gap_s, dt_s);
      }
    }
    // Zero is a fine start of a time axis; twice it is a stamp nobody set.
    if (stamp.ns < 0 || (stamp.ns == 0 && zero_stamps_++ > 0)) {
      find("stamps zero or negative", record.number);
    }
    info_.last = stamp;
    ++info_.count;
    std::visit([&](const auto& m) { look(m, record.number); }, record.measurement);
  }

  SourceInfo finish(std::vector<Finding>& findings) {
    if (!intervals_s_.empty()) {
      auto middle = intervals_s_.begin() + static_cast<std::ptrdiff_t>(intervals_s_.size() / 2);
      std::nth_element(intervals_s_.begin(), middle, intervals_s_.end());
      info_.rate_hz = 1.0 / static_cast<double>(*middle);
    }
    describeDetail();
    if (beams_ > 0) {
      const double share = static_cast<double>(bad_beams_) / static_cast<double>(beams_);
      if (share > kManyBeams) {
        find(fixed(100.0 * share, 1) + " % of the beams out of range", 1, bad_beams_);
      }
    }
    if (constant_cov_ && info_.count >= kMinForConstant && cov_) {
      find("covariance never changes: probably not measured", 1, info_.count);
    }
    for (const auto& [text, count] : found_) {
      findings.push_back({info_.source + " (" + info_.kind + ")", text, count.count, count.first});
    }
    return info_;
  }

 private:
  struct Count {
    std::size_t count = 0;
    std::size_t first = 0;
  };

  void find(const std::string& text, std::size_t number, std::size_t n = 1) {
    auto& entry = found_.try_emplace(text, Count{0, number}).first->second;
    entry.count += n;
  }

  void look(const WheelOdometry& m, std::size_t number) {
    if (!isFinite(m.T_previous_now)) {
      find("NaN", number);
      return;
    }
    const double step_m = translationNorm(m.T_previous_now);
    path_m_ += step_m;
    if (step_m > kMaxJump_m) find("jumps of more than " + fixed(kMaxJump_m, 0) + " m", number);
  }
  void look(const Imu& m, std::size_t number) {
    if (!m.omega_radps.allFinite() || !m.accel_mps2.allFinite()) {
      find("NaN", number);
    } else if (m.omega_radps.norm() > kMaxRate_radps) {
      find("rates above " + fixed(kMaxRate_radps, 0) + " rad/s (degrees?)", number);
    }
  }
  void look(const Heading& m, std::size_t number) {
    if (!std::isfinite(m.yaw_rad)) find("NaN", number);
  }
  void look(const GnssFix& m, std::size_t number) {
    ++fix_types_[m.type];
    if (m.type == GnssFixType::kNone) return;
    if (const auto* g = std::get_if<Geodetic>(&m.position)) {
      if (!std::isfinite(g->lat_deg + g->lon_deg + g->height_m)) find("NaN", number);
      if (std::abs(g->lat_deg) > 90.0 || std::abs(g->lon_deg) > 180.0) {
        find("positions out of range", number);
      }
      if (g->lat_deg == 0.0 && g->lon_deg == 0.0) find("positions at 0, 0", number);
    } else {
      const auto& p = std::get<LocalPosition>(m.position);
      if (!std::isfinite(p.east_m + p.north_m + p.up_m)) find("NaN", number);
    }
    if (!m.cov_enu) {
      find("fixes without covariance", number);
    } else if (cov_ && *cov_ != *m.cov_enu) {
      constant_cov_ = false;
    }
    if (m.cov_enu) cov_ = m.cov_enu;
  }
  void look(const LaserScan& m, std::size_t number) {
    if (info_.count > 1 && m.ranges_m.size() != scan_size_) {
      find("scans whose beam count differs from the one before", number);
    }
    scan_size_ = m.ranges_m.size();
    span_rad_ = static_cast<double>(std::max<std::size_t>(scan_size_, 1) - 1) * m.angle_step_rad;
    range_max_m_ = m.range_max_m;
    beams_ += scan_size_;
    std::size_t bad = 0;
    for (std::size_t i = 0; i < scan_size_; ++i) {
      if (!m.valid(i)) ++bad;
      if (m.ranges_m[i] < 0.0F) find("negative ranges", number);
    }
    bad_beams_ += bad;
    if (bad == scan_size_) find("scans without any valid beam", number);
    if (m.T_log_base && !isFinite(*m.T_log_base)) find("NaN", number);
  }

  void describeDetail() {
    if (info_.kind == "odometry") info_.detail = "path " + fixed(path_m_, 1) + " m";
    if (info_.kind == "gnss") {
      for (const auto& [type, n] : fix_types_) {
        if (!info_.detail.empty()) info_.detail += ", ";
        info_.detail += std::string(toString(type)) + " " + std::to_string(n);
      }
    }
    if (info_.kind == "laser") {
      info_.detail = std::to_string(scan_size_) + " beams over " + fixed(radToDeg(span_rad_), 1) +
                     " deg, to " + fixed(range_max_m_, 1) + " m, " +
                     fixed(
                         100.0 * static_cast<double>(bad_beams_) /
                             static_cast<double>(std::max<std::size_t>(beams_, 1)),
                         1) +
                     " % no echo";
    }
  }

  SourceInfo info_;
  std::map<std::string, Count> found_;
  std::size_t zero_stamps_ = 0;
  std::vector<float> intervals_s_;
  double path_m_ = 0.0;
  std::map<GnssFixType, std::size_t> fix_types_;
  std::optional<Eigen::Matrix3d> cov_;
  bool constant_cov_ = true;
  std::size_t scan_size_ = 0;
  double span_rad_ = 0.0;
  double range_max_m_ = 0.0;
  std::size_t beams_ = 0;
  std::size_t bad_beams_ = 0;
};

/// Columns padded to their widest cell, two blanks between them.
std::string table(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string text;
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      line += row[i];
      if (i + 1 < row.size()) line.append(widths[i] - row[i].size() + 2, ' ');
    }
    text += line + "\n";
  }
  return text;
}

}  // namespace

RecordingInfo inspectRecording(
    const std::string& path,
    const RecordingOptions& options,
    const std::function<void(double)>& progress) {
  const auto reader = openRecording(path, options);
  RecordingInfo info;
  info.path = path;
  info.format = reader->format();
  info.size_bytes = std::filesystem::file_size(path);
  std::map<std::pair<std::string, std::string_view>, SourceProbe> probes;
  std::size_t n = 0;
  while (const auto record = reader->next()) {
    const auto kind = kindOf(record->measurement);
    probes.try_emplace({record->source, kind}, record->source, kind).first->second.take(*record);
    const Timestamp stamp = stampOf(record->measurement);
    if (stamp.ns != 0) {
      info.first = info.first ? std::min(*info.first, stamp) : stamp;
      info.last = info.last ? std::max(*info.last, stamp) : stamp;
    }
    if (progress && ++n % kProgressStep == 0) progress(reader->progress());
  }
  for (auto& [key, probe] : probes) info.sources.push_back(probe.finish(info.findings));
  if (info.sources.empty()) {
    info.findings.push_back({path, "no laser, odometry, IMU or GNSS measurement", 0, 0});
  }
  info.notes = reader->notes();
  return info;
}

std::string RecordingInfo::toText() const {
  std::string text =
      path + "\n" + format + ", " + fixed(static_cast<double>(size_bytes) / 1e6, 1) + " MB";
  if (first && last) {
    text += ", " + fixed(toSeconds(*last - *first), 1) + " s (" + formatSeconds(*first) + " to " +
            formatSeconds(*last) + ")";
  }
  text += "\n\n";
  std::vector<std::vector<std::string>> rows{
      {"source", "kind", "count", "rate Hz", "largest gap s", "first", "last", "detail"}};
  for (const SourceInfo& s : sources) {
    rows.push_back(
        {s.source,
         s.kind,
         std::to_string(s.count),
         s.rate_hz ? fixed(*s.rate_hz, 2) : "-",
         fixed(s.largest_gap_s, 3),
         formatSeconds(s.first),
         formatSeconds(s.last),
         s.detail});
  }
  text += table(rows);
  text += findings.empty() ? "\nNothing looks wrong.\n" : "\nLooks wrong:\n";
  for (const Finding& f : findings) {
    text += "  " + f.source + ": " + f.text + ": " + std::to_string(f.count);
    if (f.first_record > 0) text += " (first at " + std::to_string(f.first_record) + ")";
    text += "\n";
  }
  if (!notes.empty()) text += "\nNotes:\n";
  for (const std::string& note : notes) text += "  " + note + "\n";
  return text;
}

std::string RecordingInfo::toJson() const {
  using nlohmann::ordered_json;
  ordered_json json;
  json["schema"] = "vestibule.recording_info";
  json["schema_version"] = 1;
  json["path"] = path;
  json["format"] = format;
  json["size_bytes"] = size_bytes;
  json["first"] = first ? ordered_json(formatSeconds(*first)) : ordered_json();
  json["last"] = last ? ordered_json(formatSeconds(*last)) : ordered_json();
  json["duration_s"] = first && last ? toSeconds(*last - *first) : 0.0;
  json["sources"] = ordered_json::array();
  for (const SourceInfo& s : sources) {
    json["sources"].push_back(
        {{"source", s.source},
         {"kind", s.kind},
         {"count", s.count},
         {"rate_hz", s.rate_hz ? ordered_json(*s.rate_hz) : ordered_json()},
         {"largest_gap_s", s.largest_gap_s},
         {"first", formatSeconds(s.first)},
         {"last", formatSeconds(s.last)},
         {"backward_stamps", s.backward_stamps},
         {"detail", s.detail}});
  }
  json["findings"] = ordered_json::array();
  for (const Finding& f : findings) {
    json["findings"].push_back(
        {{"source", f.source},
         {"text", f.text},
         {"count", f.count},
         {"first_record", f.first_record}});
  }
  json["notes"] = notes;
  // Names in a damaged file need not be UTF-8.
  return json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace vestibule::io
