#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "least_squares.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/metrics/statistics.hpp"
#include "vestibule/pipeline/time_ordered_queue.hpp"
#include "vestibule/tuning/calibration.hpp"

namespace vestibule::tuning {
namespace {

constexpr double kObserved_deg = 1.0;  // one sigma below this
/// Steel bends the readings of a while alike.
constexpr double kSteel_s = 30.0;
/// Readings without motion between them say the same.
constexpr double kLeastTravel_m = 0.1;
constexpr double kLeastTurn_rad = degToRad(1.0);
constexpr double kMostGap_s = 1.5;

struct Row {
  double at_s = 0.0;
  double bearing_rad = 0.0;    ///< as read
  double deviation_deg = 0.0;  ///< read - true
};

std::vector<Row> rowsOf(
    const std::vector<Heading>& readings, const metrics::Trajectory& reference) {
  std::vector<Row> rows;
  std::optional<Pose2> last;
  for (const Heading& reading : readings) {
    const auto after = std::lower_bound(
        reference.begin(),
        reference.end(),
        reading.stamp,
        [](const metrics::TimedPose& p, Timestamp t) { return p.stamp < t; });
    if (after == reference.end() || after == reference.begin()) continue;
    const auto before = std::prev(after);
    const double span_s = toSeconds(after->stamp - before->stamp);
    if (span_s > kMostGap_s) continue;
    const Pose2 T =
        interpolate(before->pose, after->pose, toSeconds(reading.stamp - before->stamp) / span_s);
    if (last && distance(*last, T) < kLeastTravel_m &&
        std::abs(angleDiff(T.phi, last->phi)) < kLeastTurn_rad) {
      continue;
    }
    last = T;
    // Bearing and yaw run against each other.
    rows.push_back(
        {toSeconds(reading.stamp - reference.front().stamp),
         yawFromBearing(reading.yaw_rad),
         radToDeg(angleDiff(T.phi, reading.yaw_rad))});
  }
  return rows;
}

/// Whether the robot looked in (nearly) all directions for a while.
bool allDirections(const std::vector<Row>& rows) {
  constexpr int kSectors = 12;
  constexpr int kEnough = 10;
  constexpr int kFewestRows = 3;
  std::array<int, kSectors> count{};
  for (const Row& row : rows) {
    const double true_bearing = wrapToPi(row.bearing_rad - degToRad(row.deviation_deg));
    const auto sector = static_cast<int>((true_bearing / kPi + 1.0) / 2.0 * kSectors);
    ++count[static_cast<std::size_t>(std::clamp(sector, 0, kSectors - 1))];
  }
  return std::count_if(count.begin(), count.end(), [](int n) { return n >= kFewestRows; }) >=
         kEnough;
}

CompassDeviation deviationOf(const Eigen::VectorXd& p) {
  CompassDeviation deviation;
  deviation.coefficients_deg.assign(p.begin(), p.end());
  return deviation;
}

double misfitOf(const Row& row, const CompassDeviation& deviation) {
  return radToDeg(wrapToPi(degToRad(row.deviation_deg) - deviation.at(row.bearing_rad)));
}

/// Of the deviations as directions: a mounting the wrong way round leaves them on both sides of
/// 180.
double meanDeviation(const std::vector<Row>& rows) {
  double s = 0.0;
  double c = 0.0;
  for (const Row& row : rows) {
    s += std::sin(degToRad(row.deviation_deg));
    c += std::cos(degToRad(row.deviation_deg));
  }
  return radToDeg(std::atan2(s, c));
}

}  // namespace

Calibration calibrateCompass(
    const std::vector<Heading>& readings,
    const metrics::Trajectory& reference,
    const CompassDeviation& known) {
  constexpr int kCount = 5;
  const char* const names[kCount] = {
      "deviation A", "deviation B", "deviation C", "deviation D", "deviation E"};
  const std::vector<Row> rows = rowsOf(readings, reference);
  const bool all_directions = allDirections(rows);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(kCount);
  Fit fit{none, {}, 0};
  if (rows.size() > 2 * kCount) {
    std::vector<int> groups;
    for (const Row& row : rows) groups.push_back(groupAt(row.at_s, kSteel_s));
    const auto misfits = [&rows](const Eigen::VectorXd& p) {
      const CompassDeviation deviation = deviationOf(p);
      std::vector<double> r;
      r.reserve(rows.size());
      for (const Row& row : rows) r.push_back(misfitOf(row, deviation));
      return r;
    };
    Eigen::VectorXd prior = Eigen::VectorXd::Constant(kCount, 20.0);
    prior[0] = 180.0;  // of any mounting
    Eigen::VectorXd start = none;
    start[0] = meanDeviation(rows);
    fit = robustFit(misfits, start, prior, groups);
    fit.parameters[0] = radToDeg(wrapToPi(degToRad(fit.parameters[0])));
  }
  Calibration result;
  for (int i = 0; i < kCount; ++i) {
    const double before = known.known() ? known.coefficients_deg[static_cast<std::size_t>(i)] : 0.0;
    Quantity q{names[i], "deg", before, fit.parameters[i], 0.0, ""};
    if (fit.cov.size() > 0) q.sigma = std::sqrt(fit.cov(i, i));
    if (!all_directions || fit.cov.size() == 0 || q.sigma > kObserved_deg) {
      q.unobserved = "drive in all directions, away from steel: three loops, both ways round";
    }
    result.quantities.push_back(q);
  }
  if (fit.cov.size() == 0) return result;
  Residuals residuals{"heading", "deg", {}, {}};
  const CompassDeviation found = deviationOf(fit.parameters);
  const CompassDeviation before = known.known() ? known : deviationOf(none);
  for (const Row& row : rows) {
    residuals.before.emplace_back(row.at_s, misfitOf(row, before));
    residuals.after.emplace_back(row.at_s, misfitOf(row, found));
  }
  const auto median = [](const std::vector<std::pair<double, double>>& misfits) {
    std::vector<double> sizes;
    for (const auto& [at_s, misfit] : misfits) sizes.push_back(std::abs(misfit));
    return metrics::statistics(sizes).median;
  };
  char text[96];
  std::snprintf(
      text,
      sizeof text,
      "half of the readings are within %.1f deg before, %.1f deg after (steel bends the others)",
      median(residuals.before),
      median(residuals.after));
  result.notes.emplace_back(text);
  result.residuals.push_back(std::move(residuals));
  return result;
}

CompassData readCompass(
    const std::string& log,
    const std::string& ref_path,
    const io::RecordingOptions& options,
    const pipeline::Config& config,
    const pipeline::Progress& progress) {
  CompassData data;
  io::RecordingOptions as_read = options;
  as_read.correct_headings = false;
  const auto reader = io::openRecording(log, as_read);
  pipeline::forEachInStampOrder(
      *reader,
      [&data](const Measurement& m) {
        if (const auto* heading = std::get_if<Heading>(&m)) data.readings.push_back(*heading);
      },
      progress);
  if (data.readings.empty()) {
    throw InputError(log + ": no headings (compass, IMU orientation) in it (see vestibule info)");
  }
  // What the headings are compared with does not come from them.
  pipeline::Config without = config;
  without.ekf.use.heading.clear();
  OdometryData reference = readOdometry(log, ref_path, options, without, progress);
  if (!reference.has_position) {
    throw InputError(
        log + ": neither a reference (--ref) nor GNSS fixes to compare the headings with");
  }
  data.reference = std::move(reference.reference);
  data.reference_name = std::move(reference.reference_name);
  return data;
}

}  // namespace vestibule::tuning
