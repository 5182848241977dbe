#include <algorithm>
#include <cmath>
#include <limits>

#include "readers.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::io {
namespace {

bool isWholeNumber(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

/// Rows of a CSV with the columns found by name.
class CsvTable {
 public:
  CsvTable(std::unique_ptr<ByteStream> stream, const CsvMapping& mapping)
      : lines_(std::move(stream)), delimiter_(mapping.delimiter), time_(mapping.time) {
    std::string_view header;
    if (!lines_.next(header)) throw InputError(lines_.name() + ": the file is empty");
    const auto names = splitCsvRow(header, delimiter_);
    columns_ = names.size();
    for (std::size_t i = 0; i < names.size(); ++i) index_.try_emplace(names[i], i);
    for (const std::string& column : mapping.columns()) {
      if (index_.count(column) == 0) {
        throw InputError(
            lines_.where() + ": no column '" + column + "' as the mapping wants; the header is " +
            quoted(header, 400));
      }
    }
    time_column_ = index_.at(time_.column);
  }

  bool next() {
    std::string_view line;
    do {
      if (!lines_.next(line)) {
        if (!any_) {
          throw InputError(lines_.where() + ": no rows after the header; the file is cut off");
        }
        return false;
      }
    } while (line.find_first_not_of(" \t") == std::string_view::npos);
    cells_ = splitCsvRow(line, delimiter_);
    if (cells_.size() != columns_) {
      throw InputError(
          lines_.where() + ": " + std::to_string(cells_.size()) + " cells, the header has " +
          std::to_string(columns_) + "; the file is cut off or damaged here");
    }
    any_ = true;
    stamp_ = parseTime(cells_[time_column_]);
    return true;
  }

  [[nodiscard]] Timestamp stamp() const { return stamp_; }
  /// Empty for a missing or nan cell of an optional column. Throws InputError where it must not be
  /// missing, and for text that is no number.
  [[nodiscard]] std::optional<double> number(const std::string& column, bool optional) const {
    const std::string& cell = cells_[index_.at(column)];
    double value = 0.0;
    const bool parsed = parseNumber(cell, value);
    if (parsed && std::isfinite(value)) return value;
    const bool missing = cell.empty() || (parsed && std::isnan(value));
    if (missing && optional) return std::nullopt;
    throw InputError(
        lines_.where() + ": column '" + column + "' is " + quoted(cell) +
        ", not a finite number; " +
        (missing ? "mark it 'optional: true' in the column mapping if gaps are normal"
                 : "correct the cell or remove the row"));
  }
  [[nodiscard]] std::string where() const { return lines_.where(); }
  [[nodiscard]] std::size_t lineNumber() const { return lines_.lineNumber(); }
  [[nodiscard]] double progress() const { return lines_.progress(); }

 private:
  Timestamp parseTime(const std::string& cell) const {
    // For a power of ten the decimal point of a whole number moves: no digit of it is lost.
    std::string text = cell;
    double factor = time_.unit_s;
    for (const auto& [unit_s, digits] :
         {std::pair{1e-3, 3U}, std::pair{1e-6, 6U}, std::pair{1e-9, 9U}}) {
      if (time_.unit_s != unit_s || !isWholeNumber(cell)) continue;
      if (text.size() <= digits) text.insert(0, digits + 1 - text.size(), '0');
      text.insert(text.size() - digits, 1, '.');
      factor = 1.0;
    }
    double number = 0.0;
    if (factor != 1.0 && parseNumber(cell, number)) {
      constexpr double kMaxSeconds = 4.6e9;
      if (std::abs(number * factor) < kMaxSeconds) return timestampFromSeconds(number * factor);
    }
    const auto stamp = factor == 1.0 ? parseStamp(text) : std::nullopt;
    if (!stamp) {
      throw InputError(
          lines_.where() + ": time column '" + time_.column + "' is " + quoted(cell) +
          ", not a time; correct the cell or remove the row");
    }
    return *stamp;
  }

  LineReader lines_;
  std::string delimiter_;
  CsvTime time_;
  std::map<std::string, std::size_t> index_;
  std::size_t columns_ = 0;
  std::size_t time_column_ = 0;
  std::vector<std::string> cells_;
  Timestamp stamp_;
  bool any_ = false;
};

Point2 toEastNorth(double x, double y, CsvAxes axes) {
  return axes == CsvAxes::kNorthEast ? Point2{y, x} : Point2{x, y};
}

class CsvReader : public RecordingReader {
 public:
  CsvReader(std::unique_ptr<ByteStream> stream, const CsvMapping& mapping, const SensorRig& rig)
      : table_(std::move(stream), mapping),
        mapping_(mapping),
        rig_(rig),
        gnss_previous_(mapping.gnss.size()) {
    for (const CsvGnss& gnss : mapping_.gnss) max_delay_s_ = std::max(max_delay_s_, gnss.delay_s);
    if (mapping_.wheels) max_delay_s_ = std::max(max_delay_s_, mapping_.wheels->delay_s);
    if (mapping_.heading) max_delay_s_ = std::max(max_delay_s_, mapping_.heading->delay_s);
    if (mapping_.yaw_rate) max_delay_s_ = std::max(max_delay_s_, mapping_.yaw_rate->delay_s);
  }

  std::optional<Record> next() override {
    // A known delay is known beforehand: records wait until nothing earlier can come, so that they
    // leave in the order in which they were true.
    while (pending_.empty() || pending_.begin()->first > release_) {
      if (at_end_) {
        if (pending_.empty()) return std::nullopt;
        break;
      }
      if (table_.next()) {
        takeRow();
        release_ = table_.stamp() - durationFromSeconds(max_delay_s_);
      } else {
        at_end_ = true;
      }
    }
    Record record = std::move(pending_.begin()->second);
    pending_.erase(pending_.begin());
    return record;
  }
  [[nodiscard]] double progress() const override { return table_.progress(); }
  [[nodiscard]] std::vector<std::string> notes() const override { return notes_.texts("line"); }
  [[nodiscard]] std::string format() const override { return "CSV"; }
  [[nodiscard]] const SensorRig& rig() const override { return rig_; }

 private:
  void takeRow() {
    const Timestamp now = table_.stamp();
    const double dt_s = previous_row_ ? toSeconds(now - *previous_row_) : 0.0;
    if (previous_row_ && dt_s <= 0.0) notes_.add("rows whose time does not advance", line());
    takeWheels(dt_s);
    takeHeading(dt_s);
    takeYawRate();
    for (std::size_t i = 0; i < mapping_.gnss.size(); ++i) takeGnss(i);
    previous_row_ = now;
  }

  void takeWheels(double dt_s) {
    if (!mapping_.wheels) return;
    const CsvWheels& wheels = *mapping_.wheels;
    const auto left = table_.number(wheels.left, wheels.optional);
    const auto right = table_.number(wheels.right, wheels.optional);
    if (!left || !right || dt_s <= 0.0) return;
    if (dt_s > wheels.max_dt_s) {
      notes_.add("gaps without wheel odometry", line());
      return;
    }
    const double unit_mps = wheels.unit_mps * wheels.distance_scale;
    const double speed_mps = 0.5 * unit_mps * (*left + *right);
    const double rate_radps = unit_mps * (*right - *left) / wheels.track_m;
    const Pose2 T = expSe2({speed_mps * dt_s, 0.0, rate_radps * dt_s});
    const Timestamp stamp = delayed(wheels.delay_s);
    push("wheels", stamp, WheelOdometry{stamp, dt_s, T});
  }

  void takeHeading(double dt_s) {
    if (!mapping_.heading) return;
    const CsvHeading& heading = *mapping_.heading;
    const auto cell = table_.number(heading.column, heading.optional);
    if (!cell) {
      yaw_.reset();
      return;
    }
    double yaw_rad = *cell * heading.unit_rad;
    if (heading.clockwise_from_north) yaw_rad = yawFromBearing(yaw_rad);
    const Timestamp stamp = delayed(heading.delay_s);
    const CompassDeviation& compass = heading.compass.known() ? heading.compass : rig_.compass;
    const Heading measured = compass.corrected(
        {stamp, wrapToPi(yaw_rad + heading.offset_rad), heading.sigma_rad, std::nullopt});
    yaw_rad = measured.yaw_rad;
    if (mapping_.yaw_rate && mapping_.yaw_rate->from_heading && yaw_ && dt_s > 0.0) {
      pushRate(stamp, angleDiff(yaw_rad, *yaw_) / dt_s);
    }
    yaw_ = yaw_rad;
    if (heading.emit) push("heading", stamp, measured);
  }

  void takeYawRate() {
    if (!mapping_.yaw_rate || !mapping_.yaw_rate->column) return;
    const CsvYawRate& yaw_rate = *mapping_.yaw_rate;
    const auto rate = table_.number(*yaw_rate.column, yaw_rate.optional);
    if (rate) pushRate(delayed(yaw_rate.delay_s), yaw_rate.sign * *rate);
  }

  void pushRate(Timestamp stamp, double rate_radps) {
    push("yaw_rate", stamp, Imu{stamp, {0.0, 0.0, rate_radps}, Eigen::Vector3d::Zero()});
  }

  void takeGnss(std::size_t index) {
    const CsvGnss& gnss = mapping_.gnss[index];
    GnssFix fix;
    fix.stamp = delayed(gnss.delay_s);
    fix.type = gnss.type;
    const bool geodetic = gnss.lat.has_value();
    const auto a = table_.number(geodetic ? *gnss.lat : *gnss.x, gnss.optional);
    const auto b = table_.number(geodetic ? *gnss.lon : *gnss.y, gnss.optional);
    if (!a || !b) return;
    const auto& vertical = geodetic ? gnss.height : gnss.z;
    const double up_m = vertical ? table_.number(*vertical, true).value_or(0.0) : 0.0;
    if (geodetic) {
      if (std::abs(*a) > 90.0 || std::abs(*b) > 180.0) {
        throw InputError(
            table_.where() + ": latitude " + std::to_string(*a) + ", longitude " +
            std::to_string(*b) + " is not on Earth; check the columns of the mapping");
      }
      fix.position = Geodetic{*a, *b, up_m};
    } else {
      const Point2 p = toEastNorth(*a - gnss.origin_m[0], *b - gnss.origin_m[1], gnss.axes);
      fix.position = LocalPosition{p.x, p.y, up_m};
    }
    auto& previous = gnss_previous_[index];
    const bool held = gnss.repeats_are_stale && previous && previous->x == *a && previous->y == *b;
    previous = Point2{*a, *b};
    if (held) {
      notes_.add("held fixes of '" + gnss.name + "' left out", line());
      return;
    }
    if (gnss.sigma_m) {
      const double h = *gnss.sigma_m * *gnss.sigma_m;
      const double v = gnss.sigma_vertical_m.value_or(*gnss.sigma_m);
      fix.cov_enu = Eigen::Vector3d(h, h, v * v).asDiagonal();
    }
    fix.velocity = velocityOf(gnss);
    push(gnss.name, fix.stamp, fix);
  }

  std::optional<GnssVelocity> velocityOf(const CsvGnss& gnss) {
    if (!gnss.v_x || !gnss.v_y) return std::nullopt;
    const auto v_x = table_.number(*gnss.v_x, true);
    const auto v_y = table_.number(*gnss.v_y, true);
    if (!v_x || !v_y) return std::nullopt;
    const Point2 v = toEastNorth(*v_x, *v_y, gnss.axes);
    return GnssVelocity{{v.x, v.y, std::numeric_limits<double>::quiet_NaN()}, gnss.sigma_mps};
  }

  [[nodiscard]] Timestamp delayed(double delay_s) const {
    return table_.stamp() - durationFromSeconds(delay_s);
  }
  [[nodiscard]] std::size_t line() const { return table_.lineNumber(); }
  void push(const std::string& source, Timestamp stamp, Measurement measurement) {
    pending_.emplace(stamp, Record{line(), source, std::move(measurement)});
  }

  CsvTable table_;
  CsvMapping mapping_;
  SensorRig rig_;
  double max_delay_s_ = 0.0;
  std::multimap<Timestamp, Record> pending_;  // equal stamps keep the order of insertion
  Timestamp release_;
  bool at_end_ = false;
  std::optional<Timestamp> previous_row_;
  std::optional<double> yaw_;
  std::vector<std::optional<Point2>> gnss_previous_;
  Notes notes_;
};

}  // namespace

std::vector<std::string> splitCsvRow(std::string_view line, const std::string& delimiter) {
  std::vector<std::string> cells;
  std::size_t begin = 0;
  for (;;) {
    const std::size_t end = std::min(line.find(delimiter, begin), line.size());
    std::string_view cell = line.substr(begin, end - begin);
    while (!cell.empty() && cell.front() == ' ') cell.remove_prefix(1);
    while (!cell.empty() && (cell.back() == ' ' || cell.back() == '\r')) cell.remove_suffix(1);
    if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"') {
      cell = cell.substr(1, cell.size() - 2);
    }
    cells.emplace_back(cell);
    if (end == line.size()) return cells;
    begin = end + delimiter.size();
  }
}

std::unique_ptr<RecordingReader> openCsv(
    std::unique_ptr<ByteStream> stream, const CsvMapping& mapping, const SensorRig& rig) {
  return std::make_unique<CsvReader>(std::move(stream), mapping, rig);
}

std::optional<Trajectory> readCsvReference(
    std::unique_ptr<ByteStream> stream, const CsvMapping& mapping) {
  if (!mapping.reference) return std::nullopt;
  const CsvReference& reference = *mapping.reference;
  CsvTable table(std::move(stream), mapping);
  Trajectory trajectory;
  while (table.next()) {
    const auto x = table.number(reference.x, true);
    const auto y = table.number(reference.y, true);
    const auto yaw = reference.yaw ? table.number(*reference.yaw, true) : 0.0;
    if (!x || !y || !yaw) continue;
    const Point2 p = toEastNorth(*x, *y, reference.axes);
    const double yaw_rad = reference.yaw_clockwise_from_north ? yawFromBearing(*yaw) : *yaw;
    trajectory.push_back({table.stamp(), toPose3({p.x, p.y, wrapToPi(yaw_rad)})});
  }
  return trajectory;
}

}  // namespace vestibule::io
