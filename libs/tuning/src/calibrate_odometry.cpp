#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "calibrate_antenna.hpp"
#include "drive_list.hpp"
#include "least_squares.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/io/trajectory.hpp"
#include "vestibule/pipeline/fuse.hpp"
#include "vestibule/pipeline/time_ordered_queue.hpp"
#include "vestibule/tuning/calibration.hpp"

namespace vestibule::tuning {
namespace {

constexpr double kSegment_s = 3.0;
/// Errors of wheels and reference are taken for independent from one such stretch to the next.
constexpr double kGroup_s = 20.0;
constexpr double kGap_s = 1.5;  // a segment with such a hole in the wheel messages is left out
constexpr std::size_t kFewestSegments = 8;
// What counts as observed: one sigma below this.
constexpr double kScaleSigma = 0.02;
constexpr double kIcrShare = 0.05;  // of the believed track
constexpr double kIcrX_m = 0.05;
// A quick procedure takes straights and spins, told apart by what the wheels claim.
constexpr double kStraight_radpm = 0.05;
constexpr double kSpin_radpm = 5.0;

enum Index { kScaleLeft, kScaleRight, kIcrLeft, kIcrRight, kIcrX, kCount };

/// A stretch of a few seconds: what the wheels said and what was true.
struct Segment {
  std::size_t from = 0;  ///< odometry messages (from, to]
  std::size_t to = 0;
  Pose2 T_from_to;  ///< true
  double start_s = 0.0;
};

/// True body motion of one wheel increment.
Pose2 moved(const WheelOdometry& m, const Eigen::VectorXd& p, double track_m) {
  const Eigen::Vector3d twist = logSe2(m.T_previous_now);
  const double V_l = p[kScaleLeft] * (twist.x() - 0.5 * track_m * twist.z());
  const double V_r = p[kScaleRight] * (twist.x() + 0.5 * track_m * twist.z());
  const double width = p[kIcrLeft] - p[kIcrRight];
  const double w = (V_r - V_l) / width;
  const double v_x = (V_r * p[kIcrLeft] - V_l * p[kIcrRight]) / width;
  return expSe2({v_x, -w * p[kIcrX], w});
}

Pose2 predicted(
    const std::vector<WheelOdometry>& odometry,
    const Segment& s,
    const Eigen::VectorXd& p,
    double track_m) {
  Pose2 T;
  for (std::size_t i = s.from + 1; i <= s.to; ++i) T = compose(T, moved(odometry[i], p, track_m));
  return T;
}

Eigen::Vector3d errorOf(
    const std::vector<WheelOdometry>& odometry,
    const Segment& s,
    const Eigen::VectorXd& p,
    double track_m) {
  const Pose2 e = between(s.T_from_to, predicted(odometry, s, p, track_m));
  return {e.x, e.y, e.phi};
}

/// Reference poses at the stamps of the wheel messages; empty where there is none.
std::vector<std::optional<Pose2>> atMessages(
    const std::vector<WheelOdometry>& odometry, const metrics::Trajectory& reference) {
  metrics::Trajectory stamps;
  for (const WheelOdometry& m : odometry) stamps.push_back({m.stamp, Pose2{}});
  metrics::AssociationOptions association;
  association.matching = metrics::Matching::kInterpolated;
  association.max_dt = std::chrono::milliseconds(1200);
  std::vector<std::optional<Pose2>> poses(odometry.size());
  std::size_t next = 0;
  for (const metrics::Match& m : metrics::associate(stamps, reference, association)) {
    while (odometry[next].stamp != m.stamp) ++next;
    poses[next++] = m.reference;
  }
  return poses;
}

std::vector<Segment> segmentsOf(
    const std::vector<WheelOdometry>& odometry, const metrics::Trajectory& reference) {
  const auto poses = atMessages(odometry, reference);
  std::vector<Segment> segments;
  const std::size_t none = odometry.size();
  std::size_t from = none;
  for (std::size_t i = 0; i < odometry.size(); ++i) {
    const bool gap = i > 0 && toSeconds(odometry[i].stamp - odometry[i - 1].stamp) > kGap_s;
    if (gap) from = none;
    if (!poses[i]) continue;
    if (from == none) {
      from = i;
    } else if (toSeconds(odometry[i].stamp - odometry[from].stamp) >= kSegment_s - 1e-6) {
      const double at_s = toSeconds(odometry[from].stamp - odometry.front().stamp);
      segments.push_back({from, i, between(*poses[from], *poses[i]), at_s});
      from = i;
    }
  }
  return segments;
}

double medianOf(std::vector<double> v) {
  if (v.empty()) return 0.0;
  const auto middle = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
  std::nth_element(v.begin(), middle, v.end());
  return *middle;
}

/// Robust sigma of position and yaw errors under the present parameters.
Eigen::Vector2d scatter(const std::vector<Eigen::Vector3d>& errors) {
  std::vector<double> position;
  std::vector<double> yaw;
  for (const auto& e : errors) {
    position.push_back(std::abs(e.x()));
    position.push_back(std::abs(e.y()));
    yaw.push_back(std::abs(e.z()));
  }
  return {std::max(1e-4, 1.4826 * medianOf(position)), std::max(1e-5, 1.4826 * medianOf(yaw))};
}

/// Straights give the scale, spins the effective track: no least squares, a check by hand.
void quickProcedure(
    const std::vector<WheelOdometry>& odometry,
    const std::vector<Segment>& segments,
    double track_m,
    bool has_position,
    OdometryCalibration& result) {
  double true_m = 0.0;
  double wheel_m = 0.0;
  double true_rad = 0.0;
  double wheel_travel_m = 0.0;
  for (const Segment& s : segments) {
    double d = 0.0;
    double turn = 0.0;
    double along = 0.0;
    for (std::size_t i = s.from + 1; i <= s.to; ++i) {
      const Eigen::Vector3d twist = logSe2(odometry[i].T_previous_now);
      d += std::abs(twist.x());
      turn += twist.z();
      along += twist.x();
    }
    if (std::abs(along) > 0.5 && std::abs(turn) < kStraight_radpm * d) {
      true_m += translationNorm(s.T_from_to);
      wheel_m += std::abs(along);
    } else if (std::abs(turn) > 0.3 && std::abs(turn) > kSpin_radpm * d) {
      true_rad += std::abs(s.T_from_to.phi);
      wheel_travel_m += track_m * std::abs(turn);  // integral of V_r - V_l
    }
  }
  if (has_position && wheel_m > 3.0) result.quick_scale = true_m / wheel_m;
  if (true_rad > 3.0) {
    result.quick_track_m = result.quick_scale.value_or(1.0) * wheel_travel_m / true_rad;
  }
}

/// The square of the UMBmark test as the odometry would drive it, and where it truly ends.
Point2 squareEnd(const Eigen::VectorXd& p, double track_m, bool clockwise) {
  constexpr double kSide_m = 4.0;
  constexpr int kSteps = 400;
  Pose2 T;
  const double turn = (clockwise ? -0.5 : 0.5) * kPi;
  for (int side = 0; side < 4; ++side) {
    for (int i = 0; i < kSteps; ++i) {
      WheelOdometry m;
      m.T_previous_now = {kSide_m / kSteps, 0.0, 0.0};
      T = compose(T, moved(m, p, track_m));
    }
    for (int i = 0; i < kSteps; ++i) {
      WheelOdometry m;
      m.T_previous_now = {0.0, 0.0, turn / kSteps};
      T = compose(T, moved(m, p, track_m));
    }
  }
  return {T.x, T.y};
}

UmbMark umbMark(const Eigen::VectorXd& p, double track_m) {
  UmbMark u;
  u.gravity_cw = squareEnd(p, track_m, true);
  u.gravity_ccw = squareEnd(p, track_m, false);
  const double L = 4.0;
  u.alpha_rad = (u.gravity_cw.x + u.gravity_ccw.x) / (-4.0 * L);
  u.beta_rad = (u.gravity_cw.x - u.gravity_ccw.x) / (-4.0 * L);
  u.wheel_ratio = p[kScaleRight] / p[kScaleLeft];
  u.track_ratio = (p[kIcrLeft] - p[kIcrRight]) / track_m;
  return u;
}

metrics::Trajectory integrated(
    const std::vector<WheelOdometry>& odometry,
    const Pose2& T_map_start,
    const Eigen::VectorXd& p,
    double track_m) {
  metrics::Trajectory path;
  Pose2 T = T_map_start;
  for (std::size_t i = 0; i < odometry.size(); ++i) {
    if (i > 0) T = compose(T, moved(odometry[i], p, track_m));
    path.push_back({odometry[i].stamp, T});
  }
  return path;
}

}  // namespace

namespace {

double rootMeanSquare(const std::vector<std::pair<double, double>>& r) {
  double sum = 0.0;
  for (const auto& entry : r) sum += entry.second * entry.second;
  return r.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(r.size()));
}

}  // namespace

double Residuals::rmsBefore() const { return rootMeanSquare(before); }
double Residuals::rmsAfter() const { return rootMeanSquare(after); }

const Quantity* Calibration::find(const std::string& name) const {
  for (const Quantity& q : quantities) {
    if (q.name == name) return &q;
  }
  return nullptr;
}

OdometryCalibration calibrateOdometry(
    const std::vector<WheelOdometry>& odometry,
    const metrics::Trajectory& reference,
    bool has_position,
    double track_m,
    const ReferenceErrors& reference_errors) {
  const std::vector<Segment> segments = segmentsOf(odometry, reference);
  if (segments.size() < kFewestSegments) {
    throw InputError(
        "only " + std::to_string(segments.size()) + " stretches of " +
        std::to_string(static_cast<int>(kSegment_s)) +
        " s with wheels and reference together; a calibration needs at least " +
        std::to_string(kFewestSegments));
  }
  Eigen::VectorXd start(kCount);
  start << 1.0, 1.0, 0.5 * track_m, -0.5 * track_m, 0.0;
  Eigen::VectorXd prior(kCount);
  // Without positions the scales and the centre of rotation stay where they are.
  const double scale_prior = has_position ? 0.3 : 1e-6;
  const double x_prior = has_position ? track_m : 1e-6;
  prior << scale_prior, scale_prior, 2.0 * track_m, 2.0 * track_m, x_prior;

  const auto errors = [&](const Eigen::VectorXd& p) {
    std::vector<Eigen::Vector3d> e;
    for (const Segment& s : segments) e.push_back(errorOf(odometry, s, p, track_m));
    return e;
  };
  std::vector<int> groups;
  for (const Segment& s : segments) {
    groups.insert(groups.end(), 3, static_cast<int>(s.start_s / kGroup_s));
  }
  Fit fit;
  fit.parameters = start;
  Eigen::Vector2d sigma(0.05, 0.02);
  // The scatter about the fit is the noise: it is known after the first round.
  for (int round = 0; round < 3; ++round) {
    const auto residuals = [&](const Eigen::VectorXd& p) {
      Eigen::VectorXd r(static_cast<Eigen::Index>(3 * segments.size()));
      const auto e = errors(p);
      for (std::size_t i = 0; i < e.size(); ++i) {
        const auto at = static_cast<Eigen::Index>(3 * i);
        r[at] = has_position ? e[i].x() / sigma[0] : 0.0;
        r[at + 1] = has_position ? e[i].y() / sigma[0] : 0.0;
        r[at + 2] = e[i].z() / sigma[1];
      }
      return r;
    };
    fit = leastSquares(residuals, start, prior, groups);
    sigma = scatter(errors(fit.parameters));
  }

  OdometryCalibration result;
  const Eigen::VectorXd& p = fit.parameters;
  result.track_m = track_m;
  result.wheels = {p[kScaleLeft], p[kScaleRight], p[kIcrLeft], p[kIcrRight], p[kIcrX]};
  const auto before = errors(start);
  const auto after = errors(p);
  Residuals residuals{"wheels", has_position ? "m" : "rad", {}, {}};
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const auto size = [has_position](const Eigen::Vector3d& e) {
      return has_position ? e.head<2>().norm() : std::abs(e.z());
    };
    residuals.before.emplace_back(segments[i].start_s, size(before[i]));
    residuals.after.emplace_back(segments[i].start_s, size(after[i]));
  }
  result.residuals.push_back(std::move(residuals));
  result.notes.push_back(
      std::to_string(segments.size()) + " stretches of " +
      std::to_string(static_cast<int>(kSegment_s)) + " s");

  const auto add = [&](const std::string& name,
                       const std::string& unit,
                       double was,
                       double value,
                       const Eigen::VectorXd& gradient,
                       double limit,
                       const std::string& drive) {
    const double by_reference = name == "ICR ahead of base" ? reference_errors.ahead_sigma_m
                                : unit == "m" ? reference_errors.turn_scale_sigma * value
                                              : 0.0;
    Quantity q{
        name,
        unit,
        was,
        value,
        std::hypot(std::sqrt(gradient.dot(fit.cov * gradient)), by_reference),
        ""};
    const bool position = name != "effective track";
    if (position && !has_position) {
      q.unobserved = "no position to compare with: give --ref, or a recording with GNSS";
    } else if (q.sigma > limit) {
      q.unobserved = drive;
    }
    result.quantities.push_back(q);
  };
  const auto unit = [](int i) -> Eigen::VectorXd { return Eigen::VectorXd::Unit(kCount, i); };
  const std::string straight = "drive straight, forth and back, some 20 m in all";
  const std::string turns = "turn on the spot, both ways, several times";
  add("left wheel scale", "", 1.0, p[kScaleLeft], unit(kScaleLeft), kScaleSigma, straight);
  add("right wheel scale", "", 1.0, p[kScaleRight], unit(kScaleRight), kScaleSigma, straight);
  const double icr = kIcrShare * track_m;
  add("left ICR", "m", start[kIcrLeft], p[kIcrLeft], unit(kIcrLeft), icr, turns);
  add("right ICR", "m", start[kIcrRight], p[kIcrRight], unit(kIcrRight), icr, turns);
  add("effective track",
      "m",
      track_m,
      p[kIcrLeft] - p[kIcrRight],
      unit(kIcrLeft) - unit(kIcrRight),
      icr,
      turns);
  add("ICR ahead of base", "m", 0.0, p[kIcrX], unit(kIcrX), kIcrX_m, turns);
  quickProcedure(odometry, segments, track_m, has_position, result);
  result.umbmark = umbMark(p, track_m);
  result.reference = reference;
  const auto poses = atMessages(odometry, reference);
  const auto first =
      std::find_if(poses.begin(), poses.end(), [](const auto& pose) { return pose.has_value(); });
  const std::vector<WheelOdometry> compared(
      odometry.begin() + (first - poses.begin()), odometry.end());
  result.before = integrated(compared, **first, start, track_m);
  result.after = integrated(compared, **first, p, track_m);
  return result;
}

namespace {

/// Lever arm and delay as the drive shows them. \return what was found, in words
std::string correctAntenna(
    std::vector<Measurement> measurements,
    pipeline::Config& config,
    pipeline::FuseOptions& fuse,
    ReferenceErrors& errors) {
  Calibration antenna;
  const bool gnss = std::any_of(measurements.begin(), measurements.end(), [](const auto& m) {
    return std::holds_alternative<GnssFix>(m);
  });
  if (gnss) calibrateAntenna(makeFilterLog(std::move(measurements)), config, false, antenna);
  const auto found = [&antenna](const char* name) {
    const Quantity* q = antenna.find(name);
    return q != nullptr && q->unobserved.empty() ? q : nullptr;
  };
  const Quantity* x = found(kAntennaX);
  const Quantity* y = found(kAntennaY);
  const Quantity* late = found(kGnssLate);
  // Together or not at all: each stands in for a part of the others.
  if (x == nullptr || y == nullptr || late == nullptr) {
    return gnss ? " (antenna where it is configured)" : "";
  }
  errors.ahead_sigma_m = x->sigma;
  config.rig.p_base_antenna = {x->value, y->value};
  fuse.gnss_late_s = late->value;
  char text[96];
  std::snprintf(
      text,
      sizeof text,
      " (antenna at %.2f, %.2f m, fixes late by %.3f s)",
      x->value,
      y->value,
      late->value);
  return text;
}

}  // namespace

OdometryData readOdometry(
    const std::string& log,
    const std::string& ref_path,
    const io::RecordingOptions& options,
    const pipeline::Config& config,
    const pipeline::Progress& progress) {
  OdometryData data;
  const auto reader = io::openRecording(log, options);
  std::vector<Measurement> measurements;
  pipeline::forEachInStampOrder(
      *reader,
      [&](const Measurement& m) {
        if (!std::holds_alternative<LaserScan>(m)) measurements.push_back(m);
        const auto* wheels = std::get_if<WheelOdometry>(&m);
        if (wheels == nullptr) return;
        if (!data.odometry.empty() && wheels->stamp <= data.odometry.back().stamp) return;
        data.odometry.push_back(*wheels);
      },
      progress);
  if (data.odometry.empty()) {
    throw InputError(log + ": no wheel odometry in it (see vestibule info)");
  }
  io::Trajectory poses;
  if (!ref_path.empty()) {
    poses = io::readTum(ref_path);
    data.reference_name = ref_path;
  } else if (auto own = io::readReference(log, options)) {
    poses = std::move(*own);
    data.reference_name = "the recording's reference";
  }
  for (const io::StampedPose& p : poses) data.reference.push_back({p.stamp, toPose2(p.T)});
  data.has_position = !data.reference.empty();
  if (data.has_position) return data;
  data.errors.turn_scale_sigma = config.ekf.gyro.scale_sigma;
  pipeline::Config corrected = config;
  pipeline::FuseOptions smooth;
  smooth.smooth = true;
  const std::string known = correctAntenna(std::move(measurements), corrected, smooth, data.errors);
  const pipeline::FuseResult fused =
      pipeline::fuse(log, options, corrected, smooth, Observers{}, progress);
  data.reference = fused.trajectory;
  data.has_position = fused.ready_after_s.has_value();
  data.reference_name = data.has_position ? "the smoothed path of GNSS, gyro and wheels" + known
                                          : "the gyro (no GNSS: turns only)";
  return data;
}

}  // namespace vestibule::tuning
