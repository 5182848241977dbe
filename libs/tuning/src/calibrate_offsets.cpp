#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calibrate_antenna.hpp"
#include "least_squares.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/pipeline/fuse.hpp"
#include "vestibule/pipeline/time_ordered_queue.hpp"
#include "vestibule/tuning/calibration.hpp"

namespace vestibule::tuning {
namespace {

constexpr double kReach_s = 1.5;
constexpr double kSigma_s = 0.05;  // what counts as observed: one sigma below this
constexpr double kWindow_s = 0.4;  // of the turns that are compared
constexpr std::size_t kFewestWindows = 50;
/// Of the wheels' turns the gyro has to explain so much: those of a straight drive are slip.
constexpr double kExplained = 0.9;
constexpr const char* kTurns = "turn on the spot or drive curves, both ways";

/// An angle that has been summed up, at ascending stamps [s].
struct Sum {
  std::vector<double> at_s;
  std::vector<double> value;

  [[nodiscard]] bool covers(double t_s) const {
    return !at_s.empty() && t_s >= at_s.front() && t_s <= at_s.back();
  }
  /// \pre covers(t_s)
  [[nodiscard]] double at(double t_s) const {
    const auto after = std::lower_bound(at_s.begin(), at_s.end(), t_s);
    const auto i = static_cast<std::size_t>(after - at_s.begin());
    if (i == 0) return value.front();
    const double share = (t_s - at_s[i - 1]) / (at_s[i] - at_s[i - 1]);
    return value[i - 1] + share * (value[i] - value[i - 1]);
  }
};

/// Turns of the wheels and of the gyro.
struct Turns {
  Sum wheels;
  Sum gyro;
};

/// Where up is in the axes of the IMU, by the mean specific force; z without a full accelerometer.
Eigen::Vector3d upOf(const std::vector<Measurement>& measurements) {
  constexpr double kGravity = 9.81;
  constexpr double kTolerance = 1.0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (const Measurement& m : measurements) {
    const auto* imu = std::get_if<Imu>(&m);
    if (imu == nullptr || !imu->accel_mps2.allFinite()) continue;
    sum += imu->accel_mps2;
    ++count;
  }
  if (std::abs(sum.norm() - count * kGravity) > count * kTolerance) return Eigen::Vector3d::UnitZ();
  return count == 0 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d(sum.normalized());
}

Turns turnsOf(const std::vector<Measurement>& measurements) {
  const Eigen::Vector3d up = upOf(measurements);
  Turns turns;
  const Timestamp first = stampOf(measurements.front());
  for (const Measurement& m : measurements) {
    const double t_s = toSeconds(stampOf(m) - first);
    if (const auto* wheels = std::get_if<WheelOdometry>(&m)) {
      Sum& sum = turns.wheels;
      if (!sum.at_s.empty() && t_s <= sum.at_s.back()) continue;
      sum.value.push_back(
          (sum.value.empty() ? 0.0 : sum.value.back()) + wheels->T_previous_now.phi);
      sum.at_s.push_back(t_s);
    } else if (const auto* imu = std::get_if<Imu>(&m)) {
      Sum& sum = turns.gyro;
      if (!sum.at_s.empty() && t_s <= sum.at_s.back()) continue;
      // A reading is the mean since the one before, as the filter takes it.
      const double turned =
          sum.at_s.empty() ? 0.0
                           : sum.value.back() + imu->omega_radps.dot(up) * (t_s - sum.at_s.back());
      sum.value.push_back(turned);
      sum.at_s.push_back(t_s);
    }
  }
  return turns;
}

/// Windows [from, to] that both sensors cover whatever the delay.
std::vector<std::pair<double, double>> windowsOf(const Turns& turns) {
  std::vector<std::pair<double, double>> windows;
  const std::vector<double>& at = turns.wheels.at_s;
  for (std::size_t i = 0, j = 0; j < at.size(); ++j) {
    const double span_s = at[j] - at[i];
    if (span_s < kWindow_s) continue;
    if (span_s < 3.0 * kWindow_s && turns.gyro.covers(at[i] - kReach_s) &&
        turns.gyro.covers(at[j] + kReach_s)) {
      windows.emplace_back(at[i], at[j]);
    }
    i = j;
  }
  return windows;
}

enum TurnIndex { kLate, kShare, kBias };

/// The wheels' turns, which take place earlier than they are stamped, by those of the gyro.
class WheelTurns {
 public:
  explicit WheelTurns(const Turns& turns) : turns_(turns), windows_(windowsOf(turns)) {}

  [[nodiscard]] std::size_t windows() const { return windows_.size(); }

  [[nodiscard]] std::vector<double> misfits(const Eigen::VectorXd& p) const {
    std::vector<double> r;
    for (const auto& [from, to] : windows_) {
      r.push_back(wheels(from, to) - p[kShare] * gyro(from, to, p[kLate]) - p[kBias] * (to - from));
    }
    return r;
  }

  /// Root mean square about the mean.
  [[nodiscard]] double size() const {
    double sum = 0.0;
    double squares = 0.0;
    for (const auto& [from, to] : windows_) {
      sum += wheels(from, to);
      squares += wheels(from, to) * wheels(from, to);
    }
    const auto n = static_cast<double>(windows_.size());
    return std::sqrt(std::max(0.0, squares / n - sum * sum / (n * n)));
  }

  /// Share and bias that fit a delay best, and the root mean square they leave.
  [[nodiscard]] std::pair<Eigen::Vector3d, double> bestAt(double late_s) const {
    Eigen::Matrix2d A = 1e-9 * Eigen::Matrix2d::Identity();
    Eigen::Vector2d b = Eigen::Vector2d::Zero();
    for (const auto& [from, to] : windows_) {
      const Eigen::Vector2d row(gyro(from, to, late_s), to - from);
      A += row * row.transpose();
      b += row * wheels(from, to);
    }
    const Eigen::Vector2d x = A.ldlt().solve(b);
    const Eigen::Vector3d p(late_s, x[0], x[1]);
    double sum = 0.0;
    for (const double r : misfits(p)) sum += r * r;
    return {p, std::sqrt(sum / static_cast<double>(windows_.size()))};
  }

  [[nodiscard]] std::vector<int> groups() const {
    std::vector<int> groups;
    for (const auto& window : windows_) {
      groups.push_back(groupAt(window.first));
    }
    return groups;
  }

 private:
  [[nodiscard]] double wheels(double from, double to) const {
    return turns_.wheels.at(to) - turns_.wheels.at(from);
  }
  [[nodiscard]] double gyro(double from, double to, double late_s) const {
    return turns_.gyro.at(to - late_s) - turns_.gyro.at(from - late_s);
  }

  const Turns& turns_;
  std::vector<std::pair<double, double>> windows_;
};

/// 0 without a gyro.
double gyroPeriod(const std::vector<Measurement>& measurements) {
  const std::vector<double> at_s = turnsOf(measurements).gyro.at_s;
  if (at_s.size() < 2) return 0.0;
  return (at_s.back() - at_s.front()) / static_cast<double>(at_s.size() - 1);
}

/// Stamps of the wheels against those of the gyro, by the turns of both.
void calibrateWheels(const std::vector<Measurement>& measurements, OffsetsCalibration& result) {
  Quantity q{kWheelsLate, "s", 0.0, 0.0, 0.0, ""};
  const Turns turns = turnsOf(measurements);
  const WheelTurns fit_of(turns);
  if (turns.gyro.at_s.empty()) {
    q.unobserved = "no gyro in the recording: the wheels are the clock here";
  } else if (fit_of.windows() < kFewestWindows) {
    q.unobserved = "less than half a minute of wheels and gyro together";
  }
  if (!q.unobserved.empty()) {
    result.quantities.push_back(q);
    return;
  }
  // Coarse first: the fit only finds its way from within a turn.
  OffsetCurve curve{kWheelsLate, "wheels' turn less gyro's in 0.4 s, RMS [rad]", {}};
  std::pair<Eigen::Vector3d, double> best{{0, 1, 0}, std::numeric_limits<double>::infinity()};
  for (int i = -75; i <= 75; ++i) {
    const auto there = fit_of.bestAt(kReach_s / 75.0 * i);
    curve.points.emplace_back(there.first[kLate], there.second);
    if (there.second < best.second) best = there;
  }
  const Fit fit = robustFit(
      [&](const Eigen::VectorXd& p) {
        Eigen::VectorXd within = p;
        within[kLate] = std::clamp(p[kLate], -kReach_s, kReach_s);
        return fit_of.misfits(within);
      },
      best.first,
      Eigen::Vector3d(1.0, 1.0, 0.1),
      fit_of.groups());
  q.value = fit.parameters[kLate];
  q.sigma = std::sqrt(fit.cov(kLate, kLate));
  const double left = best.second / std::max(1e-9, fit_of.size());
  if (q.sigma > kSigma_s || std::abs(best.first[kLate]) >= kReach_s ||
      left * left > 1.0 - kExplained) {
    q.unobserved = kTurns;
  }
  result.notes.push_back(
      "the gyro explains " + std::to_string(std::lround(100.0 * (1.0 - left * left))) +
      " % of the wheels' turns");
  result.quantities.push_back(q);
  result.curves.push_back(std::move(curve));
}

/// Stamps of the fixes against wheels and gyro, with the antenna's place or for a known one.
void calibrateGnss(
    const FilterLog& log, pipeline::Config& config, bool arm_known, OffsetsCalibration& result) {
  Calibration antenna;
  OffsetCurve curve{kGnssLate, "fix less antenna by odometry, RMS [m]", {}};
  calibrateAntenna(log, config, arm_known, antenna, &curve.points);
  Quantity late = *antenna.find(kGnssLate);
  const Quantity x = *antenna.find(kAntennaX);
  const Quantity y = *antenna.find(kAntennaY);
  const bool arm_found = x.unobserved.empty() && y.unobserved.empty();
  if (arm_found) config.rig.p_base_antenna = {x.value, y.value};
  if (!late.unobserved.empty() && arm_found) {
    late.unobserved =
        "drive curves and change speed: at constant speed a delay looks like an offset";
  } else if (!late.unobserved.empty()) {
    late.unobserved =
        "the drive does not show where the antenna is, and along the way a wrong place looks like "
        "a delay: turn on the spot and drive eights, or measure rig.antenna and give --arm-known";
  }
  result.quantities.push_back(late);
  if (!arm_known) result.quantities.insert(result.quantities.end(), {x, y});
  if (!curve.points.empty()) result.curves.push_back(std::move(curve));
  result.residuals.insert(
      result.residuals.end(), antenna.residuals.begin(), antenna.residuals.end());
}

double foundOrZero(const Calibration& c, const char* name) {
  const Quantity* q = c.find(name);
  return q != nullptr && q->unobserved.empty() ? q->value : 0.0;
}

/// Stamps of the headings, by the likelihood of the innovations with everything else put right.
void calibrateHeading(
    const std::string& log,
    const io::RecordingOptions& options,
    const pipeline::Config& config,
    double gyro_period_s,
    OffsetsCalibration& result,
    const pipeline::Progress& progress) {
  const auto found = pipeline::estimateOffsets(
      log,
      options,
      config,
      {{"gnss", foundOrZero(result, kGnssLate)}, {"wheels", foundOrZero(result, kWheelsLate)}},
      progress);
  for (const pipeline::StampOffset& o : found) {
    // Between two of its messages the gyro does not say when the robot turned.
    const double between_s = gyro_period_s / std::sqrt(12.0);
    Quantity q{kHeadingLate, "s", 0.0, o.offset_s, std::hypot(o.sigma_s, between_s), ""};
    if (between_s > kSigma_s) {
      q.unobserved = "record the gyro at least ten times a second";
    } else if (!o.found || q.sigma > kSigma_s) {
      q.unobserved = kTurns;
    }
    result.quantities.push_back(q);
    result.curves.push_back({kHeadingLate, "-2 log likelihood above its least", o.misfits});
  }
}

}  // namespace

OffsetsCalibration calibrateOffsets(
    const std::string& log,
    const io::RecordingOptions& options,
    const pipeline::Config& config,
    bool arm_known,
    const pipeline::Progress& progress) {
  std::vector<Measurement> measurements;
  bool gnss = false;
  bool heading = false;
  bool wheels = false;
  const auto reader = io::openRecording(log, options);
  pipeline::forEachInStampOrder(
      *reader,
      [&](const Measurement& m) {
        if (std::holds_alternative<LaserScan>(m)) return;
        const auto* fix = std::get_if<GnssFix>(&m);
        gnss = gnss || (fix != nullptr && fix->type != GnssFixType::kNone);
        heading = heading || std::holds_alternative<Heading>(m);
        wheels = wheels || std::holds_alternative<WheelOdometry>(m);
        measurements.push_back(m);
      },
      progress);
  if (!wheels) throw InputError(log + ": no wheel odometry in it (see vestibule info)");
  OffsetsCalibration result;
  calibrateWheels(measurements, result);
  const Duration late = durationFromSeconds(foundOrZero(result, kWheelsLate));
  for (Measurement& m : measurements) {
    if (auto* odometry = std::get_if<WheelOdometry>(&m)) odometry->stamp = odometry->stamp - late;
  }
  const double gyro_period_s = heading ? gyroPeriod(measurements) : 0.0;
  pipeline::Config corrected = config;
  if (gnss) calibrateGnss(makeFilterLog(std::move(measurements)), corrected, arm_known, result);
  if (heading) {
    calibrateHeading(log, options, corrected, gyro_period_s, result, progress);
  }
  return result;
}

}  // namespace vestibule::tuning
