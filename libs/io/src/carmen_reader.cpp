#include <algorithm>
#include <array>
#include <cmath>

#include "readers.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::io {
namespace {

// A SICK LMS writes its error codes (dazzled, no echo, ...) as 8183..8191 cm.
constexpr double kSickErrorCodes_m = 81.825;
constexpr std::size_t kMountProbeLines = 20;
// So many scan lines are looked at for the front laser, where other lasers come first.
constexpr std::size_t kLaserProbeLines = 500;
constexpr double kMountTolerance_m = 0.02;
constexpr double kMountTolerance_rad = 0.01;
constexpr double kMountLimit_m = 1.0;
// A scan line is written so much after its scan at most.
constexpr double kLongestDelay_s = 1.0;
constexpr double kOnPath_m = 0.001;
constexpr double kOnPath_rad = 0.001;

constexpr std::array<std::string_view, 22> kKeywords{
    "PARAM",     "SYNC",      "ODOM",      "FLASER",      "RLASER",      "LASER3",
    "LASER4",    "LASER5",    "TRUEPOS",   "RAWLASER1",   "RAWLASER2",   "RAWLASER3",
    "RAWLASER4", "RAWLASER5", "NEFF",      "ROBOTLASER0", "ROBOTLASER1", "ROBOTLASER2",
    "NMEAGGA",   "NMEARMC",   "IPC_DELTA", "MARKER"};

/// Scan lines by the laser that is read where a log has several: the front one, else the rear one,
/// else the first of those that were recorded as they came, without poses.
constexpr std::array<std::pair<std::string_view, std::size_t>, 10> kLasers{
    {{"FLASER", 0},
     {"ROBOTLASER1", 0},
     {"L", 0},
     {"RLASER", 1},
     {"ROBOTLASER2", 1},
     {"RAWLASER1", 2},
     {"RAWLASER2", 3},
     {"RAWLASER3", 4},
     {"RAWLASER4", 5},
     {"RAWLASER5", 6}}};
constexpr std::size_t kFrontLaser = 0;
constexpr std::size_t kRearLaser = 1;
constexpr std::size_t kRanks = 7;

/// Empty for other lines.
std::optional<std::size_t> laserRank(std::string_view keyword) {
  for (const auto& [name, rank] : kLasers) {
    if (name == keyword) return rank;
  }
  return std::nullopt;
}

// Behind the line's keyword, in the notes.
constexpr const char* kMountUnknown =
    " lines do not say where the laser sits: taken to look ahead (a rear laser: back) from the "
    "robot's centre, unless the configuration's rig.laser says more";

/// Words of one line, taken in order with checks that name the place.
class Fields {
 public:
  Fields(const std::vector<std::string_view>& words, const LineReader& lines)
      : words_(words), lines_(lines) {}

  void expectWords(std::size_t n) const {
    if (words_.size() < n) {
      throw InputError(
          lines_.where() + ": " + std::string(words_[0]) + " line has " +
          std::to_string(words_.size()) + " words instead of " + std::to_string(n) +
          "; the log is cut off or damaged here");
    }
  }
  double number(std::size_t i) const {
    const double value = range(i);
    if (!std::isfinite(value)) fail(i, "a finite number");
    return value;
  }
  /// NaN and infinity are fine: they are how some recorders say "no echo".
  double range(std::size_t i) const {
    double value = 0.0;
    if (!parseNumber(words_[i], value)) fail(i, "a number");
    return value;
  }
  Pose2 pose(std::size_t i, double unit_m = 1.0) const {
    return {unit_m * number(i), unit_m * number(i + 1), wrapToPi(number(i + 2))};
  }
  Timestamp stamp(std::size_t i) const {
    const auto stamp = parseStamp(words_[i]);
    if (!stamp) fail(i, "a time in seconds");
    return *stamp;
  }
  std::size_t count(std::size_t i) const {
    const double n = number(i);
    if (n < 0.0 || n > 100000.0 || n != std::floor(n)) fail(i, "a number of readings");
    return static_cast<std::size_t>(n);
  }
  [[noreturn]] void fail(std::size_t i, const std::string& expected) const {
    throw InputError(
        lines_.where() + ": word " + std::to_string(i + 1) + " of the " + std::string(words_[0]) +
        " line is " + quoted(words_[i]) + ", not " + expected +
        "; the log is damaged here: cut the line out or get another copy");
  }

 private:
  const std::vector<std::string_view>& words_;
  const LineReader& lines_;
};

/// What one line says, before it becomes records.
struct Line {
  std::optional<LaserScan> scan;
  std::optional<Pose2> T_odom_laser;
  std::optional<Pose2> T_odom_base;  ///< RAWLASER lines have none
  Timestamp stamp;
};

// With an odd count the beams span the half circle; with an even one the last stops one step short
// of +90 degrees.
void setHalfCircle(LaserScan& scan) {
  const std::size_t n = scan.ranges_m.size();
  scan.angle_min_rad = -kPi / 2.0;
  scan.angle_step_rad = n < 2 ? kPi : kPi / static_cast<double>(n % 2 == 1 ? n - 1 : n);
}

/// Angles in logs are rounded to six digits; devices step in multiples of 0.05 degrees.
double snappedStep(double step_rad) {
  constexpr double kUnit = 0.05 * kRadPerDeg;
  const double snapped = std::round(step_rad / kUnit) * kUnit;
  return std::abs(snapped - step_rad) < 2e-6 ? snapped : step_rad;
}

// FLASER or RLASER: n r1..rn  laser x y theta  robot x y theta  ipc_time host logger_time
Line parseFlaser(const Fields& f) {
  f.expectWords(2);
  const std::size_t n = f.count(1);
  f.expectWords(n + 11);
  Line line;
  LaserScan& scan = line.scan.emplace();
  scan.range_max_m = kSickErrorCodes_m;
  scan.ranges_m.reserve(n);
  for (std::size_t i = 0; i < n; ++i) scan.ranges_m.push_back(static_cast<float>(f.range(2 + i)));
  setHalfCircle(scan);
  line.T_odom_laser = f.pose(2 + n);
  line.T_odom_base = f.pose(5 + n);
  line.stamp = f.stamp(8 + n);
  return line;
}

/// The device and its readings in a ROBOTLASER or RAWLASER line:
/// type start fov step max_range accuracy remission_mode n r1..rn m e1..em
/// \param words_after  that the line has behind them
/// \param end          set to the word behind them
LaserScan parseReadings(const Fields& f, std::size_t words_after, std::size_t& end) {
  f.expectWords(9);
  const std::size_t n = f.count(8);
  f.expectWords(10 + n);
  const std::size_t m = f.count(9 + n);
  end = 10 + n + m;
  f.expectWords(end + words_after);
  LaserScan scan;
  // The field of view in the line is the device's, also where it sends every second set of beams:
  // start and step are what places a beam.
  scan.angle_min_rad = f.number(2);
  scan.angle_step_rad = snappedStep(f.number(4));
  scan.range_max_m = std::min(f.number(5), kSickErrorCodes_m);
  if (!(scan.range_max_m > 0.0)) f.fail(5, "a positive maximum range");
  scan.ranges_m.reserve(n);
  for (std::size_t i = 0; i < n; ++i) scan.ranges_m.push_back(static_cast<float>(f.range(9 + i)));
  return scan;
}

// ROBOTLASER1 or ROBOTLASER2: readings  laser x y theta  robot x y theta
//   tv rv forward_dist side_dist turn_axis ipc_time host logger
Line parseRobotLaser(const Fields& f) {
  std::size_t p = 0;
  Line line;
  line.scan = parseReadings(f, 14, p);
  line.T_odom_laser = f.pose(p);
  line.T_odom_base = f.pose(p + 3);
  line.stamp = f.stamp(p + 11);
  return line;
}

// RAWLASERn: readings  ipc_time host logger_time
Line parseRawLaser(const Fields& f) {
  std::size_t p = 0;
  Line line;
  line.scan = parseReadings(f, 3, p);
  line.stamp = f.stamp(p);
  return line;
}

// ODOM x y theta tv rv accel ipc_time host logger_time
Line parseOdom(const Fields& f) {
  f.expectWords(10);
  Line line;
  line.T_odom_base = f.pose(1);
  line.stamp = f.stamp(7);
  return line;
}

constexpr double kCentimetre = 0.01;

// O x y theta time   (centimetres)
Line parseWeanOdometry(const Fields& f) {
  f.expectWords(5);
  Line line;
  line.T_odom_base = f.pose(1, kCentimetre);
  line.stamp = f.stamp(4);
  return line;
}

// L robot x y theta  laser x y theta  r1..rn time   (centimetres)
Line parseWeanLaser(const Fields& f, std::size_t words) {
  f.expectWords(9);
  Line line;
  line.T_odom_base = f.pose(1, kCentimetre);
  line.T_odom_laser = f.pose(4, kCentimetre);
  LaserScan& scan = line.scan.emplace();
  scan.range_max_m = kSickErrorCodes_m;
  for (std::size_t i = 7; i + 1 < words; ++i) {
    scan.ranges_m.push_back(static_cast<float>(kCentimetre * f.range(i)));
  }
  setHalfCircle(scan);
  line.stamp = f.stamp(words - 1);
  return line;
}

struct PathPoint {
  std::size_t line_number;
  Timestamp stamp;
  Pose2 T_odom_base;
};

/// When a pose was passed on the straight way between two odometry lines; empty if it is not on it.
std::optional<Timestamp> passedAt(const Pose2& T, const PathPoint& from, const PathPoint& to) {
  const Eigen::Vector3d way(
      to.T_odom_base.x - from.T_odom_base.x,
      to.T_odom_base.y - from.T_odom_base.y,
      angleDiff(to.T_odom_base.phi, from.T_odom_base.phi));
  const Eigen::Vector3d reached(
      T.x - from.T_odom_base.x, T.y - from.T_odom_base.y, angleDiff(T.phi, from.T_odom_base.phi));
  const double share = way.squaredNorm() > 0.0 ? way.dot(reached) / way.squaredNorm() : 1.0;
  const Eigen::Vector3d off = reached - std::clamp(share, 0.0, 1.0) * way;
  if (off.head<2>().norm() > kOnPath_m || std::abs(off.z()) > kOnPath_rad) return std::nullopt;
  return from.stamp +
         durationFromSeconds(std::clamp(share, 0.0, 1.0) * intervalSeconds(from.stamp, to.stamp));
}

class CarmenReader : public RecordingReader {
 public:
  CarmenReader(std::unique_ptr<ByteStream> stream, const RecordingOptions& options)
      : lines_(std::move(stream)), rig_(options.rig) {
    probeLaser();
  }

  std::optional<Record> next() override {
    while (queue_.empty()) {
      auto line = nextLine();
      if (!line) {
        if (!ahead_.empty()) {
          handOut(ahead_.size());
          continue;
        }
        if (!any_) {
          throw InputError(
              lines_.name() + ":" + std::to_string(lines_.lineNumber()) +
              ": end of the log without any laser or odometry line (FLASER, RLASER, ROBOTLASER, "
              "RAWLASER, ODOM)");
        }
        return std::nullopt;
      }
      any_ = true;
      if (keyword_ == "O") {
        hold(*line);
      } else {
        if (keyword_ == "L") date(*line);
        push(*line);
      }
    }
    Record record = std::move(queue_.front());
    queue_.pop_front();
    return record;
  }
  [[nodiscard]] double progress() const override { return lines_.progress(); }
  [[nodiscard]] std::vector<std::string> notes() const override { return notes_.texts("line"); }
  [[nodiscard]] std::string format() const override { return "CARMEN log"; }
  [[nodiscard]] const SensorRig& rig() const override { return rig_; }

 private:
  std::optional<Line> nextLine() {
    std::string_view text;
    while (lines_.next(text)) {
      splitWords(text, words_);
      if (words_.empty() || words_[0].front() == '#') continue;
      const Fields f(words_, lines_);
      keyword_ = words_[0];
      const auto rank = laserRank(keyword_);
      if (rank && rank == rank_.value_or(*rank)) return parseScan(f);
      if (keyword_ == "ODOM") return parseOdom(f);
      if (keyword_ == "O") return parseWeanOdometry(f);
      if (keyword_ == "PARAM") continue;
      for (const char c : keyword_) {
        if (c < ' ' || c > '~') {
          throw InputError(
              lines_.where() + ": line starts with " + quoted(keyword_) +
              "; this is not a CARMEN log, or it is damaged here");
        }
      }
      notes_.add(quoted(keyword_) + " lines ignored", lines_.lineNumber());
    }
    return std::nullopt;
  }

  [[nodiscard]] Line parseScan(const Fields& f) const {
    if (keyword_ == "L") return parseWeanLaser(f, words_.size());
    if (keyword_ == "FLASER" || keyword_ == "RLASER") return parseFlaser(f);
    if (keyword_.rfind("RAWLASER", 0) == 0) return parseRawLaser(f);
    return parseRobotLaser(f);
  }

  /// The robot pose of an L line is the odometry at the time of the scan, between O lines before
  /// it; its stamp is when it was written. O lines wait for the scans that were taken before them.
  void hold(const Line& line) {
    ahead_.push_back({lines_.lineNumber(), line.stamp, *line.T_odom_base});
    std::size_t too_old = 0;
    while (toSeconds(line.stamp - ahead_[too_old].stamp) > kLongestDelay_s) ++too_old;
    handOut(too_old);
  }

  void handOut(std::size_t count) {
    for (; count > 0; --count) {
      last_ = ahead_.front();
      ahead_.pop_front();
      if (auto increment = odometry_.next(last_->stamp, last_->T_odom_base)) {
        queue_.push_back({last_->line_number, "O", *increment});
      }
    }
  }

  /// Gives a scan the time at which the odometry was where it was taken.
  void date(Line& line) {
    std::size_t before = ahead_.size();  // O lines before the scan
    for (std::size_t k = ahead_.size(); k-- > 0;) {
      if (k == 0 && !last_) break;
      const auto passed = passedAt(*line.T_odom_base, k > 0 ? ahead_[k - 1] : *last_, ahead_[k]);
      if (!passed) continue;
      before = k;
      line.stamp = *passed;
      break;
    }
    handOut(before);
    last_ = PathPoint{lines_.lineNumber(), line.stamp, *line.T_odom_base};
  }

  void push(Line& line) {
    const std::size_t number = lines_.lineNumber();
    if (line.T_odom_base) {
      if (auto increment = odometry_.next(line.stamp, *line.T_odom_base)) {
        queue_.push_back({number, keyword_, *increment});
      }
    }
    if (!line.scan) return;
    LaserScan& scan = *line.scan;
    scan.stamp = line.stamp;
    scan.T_log_base = line.T_odom_base;
    scan.T_base_laser = rig_.T_base_laser;
    if (mount_from_log_ && !agrees(between(*line.T_odom_base, *line.T_odom_laser))) {
      notes_.add("laser pose beside the scan not at the laser's place on the robot", number);
    }
    if (mount_unknown_) notes_.add(keyword_ + kMountUnknown, number);
    queue_.push_back({number, keyword_, std::move(scan)});
  }

  [[nodiscard]] bool agrees(const Pose2& T_base_laser) const {
    return distance(T_base_laser, rig_.T_base_laser) <= kMountTolerance_m &&
           std::abs(angleDiff(T_base_laser.phi, rig_.T_base_laser.phi)) <= kMountTolerance_rad;
  }

  /// Which laser is read: the first by rank of those in the first lines.
  void probeLaser() {
    std::array<std::vector<std::optional<Pose2>>, kRanks> mounts;  // of the first scans of each
    std::size_t seen = 0;
    try {
      while (mounts[kFrontLaser].size() < kMountProbeLines && seen < kLaserProbeLines) {
        const auto line = nextLine();
        if (!line) break;
        if (!line->scan) continue;
        ++seen;
        auto& of_laser = mounts[*laserRank(keyword_)];
        if (of_laser.size() == kMountProbeLines) continue;
        of_laser.push_back(
            line->T_odom_laser ? std::optional(between(*line->T_odom_base, *line->T_odom_laser))
                               : std::nullopt);
      }
    } catch (const InputError&) {
      // A damaged line: next() will come to it and say so, if it is of the laser that is read.
      const auto rank = laserRank(keyword_);
      if (rank && mounts[*rank].empty()) mounts[*rank].push_back(std::nullopt);
    }
    lines_.rewind();
    notes_ = {};
    rank_ = kFrontLaser;
    for (std::size_t rank = kRanks; rank-- > 0;) {
      if (!mounts[rank].empty()) rank_ = rank;
    }
    chooseMount(mounts[*rank_]);
  }

  /// Where the laser sits follows from the two poses of a line, if the first lines agree on it.
  /// Two equal poses say nothing: most recorders without a known offset write those.
  void chooseMount(const std::vector<std::optional<Pose2>>& T_base_laser) {
    if (T_base_laser.empty()) return;
    const SensorRig given = rig_;
    rig_.T_base_laser = T_base_laser.front().value_or(Pose2{});
    const bool constant = std::all_of(
        T_base_laser.begin(), T_base_laser.end(), [this](const std::optional<Pose2>& T) {
          return T && agrees(*T);
        });
    const double offset_m = translationNorm(rig_.T_base_laser);
    const bool carried = offset_m > 1e-6 || std::abs(rig_.T_base_laser.phi) > 1e-6;
    mount_from_log_ = constant && carried && offset_m < kMountLimit_m;
    if (mount_from_log_) return;
    rig_ = given;
    const bool configured =
        translationNorm(given.T_base_laser) > 0.0 || given.T_base_laser.phi != 0.0;
    mount_unknown_ = *rank_ != kFrontLaser && !configured;
    if (mount_unknown_ && *rank_ == kRearLaser) rig_.T_base_laser.phi = kPi;
  }

  LineReader lines_;
  SensorRig rig_;
  std::optional<std::size_t> rank_;  // of the laser that is read; empty while probing
  std::vector<std::string_view> words_;
  std::string keyword_;
  OdometryDifferencer odometry_;
  std::deque<Record> queue_;
  std::deque<PathPoint> ahead_;    // O lines not handed out yet
  std::optional<PathPoint> last_;  // handed out, of O and L lines
  Notes notes_;
  bool mount_from_log_ = false;
  bool mount_unknown_ = false;
  bool any_ = false;
};

}  // namespace

std::optional<WheelOdometry> OdometryDifferencer::next(Timestamp stamp, const Pose2& T_odom_base) {
  std::optional<WheelOdometry> increment;
  if (previous_) {
    increment = WheelOdometry{
        stamp,
        intervalSeconds(previous_->stamp, stamp),
        between(previous_->T_odom_base, T_odom_base)};
  }
  previous_ = Previous{stamp, T_odom_base};
  return increment;
}

bool looksLikeCarmen(std::string_view head) {
  std::vector<std::string_view> words;
  std::size_t begin = 0;
  while (begin < head.size()) {
    const std::size_t end = std::min(head.find('\n', begin), head.size());
    std::string_view line = head.substr(begin, end - begin);
    begin = end + 1;
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    splitWords(line, words);
    if (words.empty() || words[0].front() == '#') continue;
    for (const std::string_view keyword : kKeywords) {
      if (words[0] == keyword) return true;
    }
    return (words[0] == "O" || words[0] == "L") && words.size() >= 2;
  }
  // Nothing but comments so far: other text formats here do not have any.
  return !head.empty() && head.front() == '#';
}

std::unique_ptr<RecordingReader> openCarmen(
    std::unique_ptr<ByteStream> stream, const RecordingOptions& options) {
  return std::make_unique<CarmenReader>(std::move(stream), options);
}

}  // namespace vestibule::io
