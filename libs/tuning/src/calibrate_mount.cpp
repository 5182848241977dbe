#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>

#include "calibrate_antenna.hpp"
#include "filter_replay.hpp"
#include "least_squares.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/pipeline/gnss_input.hpp"
#include "vestibule/pipeline/map.hpp"
#include "vestibule/pipeline/time_ordered_queue.hpp"
#include "vestibule/tuning/calibration.hpp"
#include "vestibule/tuning/parameter_tree.hpp"

namespace vestibule::tuning {
namespace {

// What counts as observed: one sigma below this.
constexpr double kArmSigma_m = 0.05;
constexpr double kDelaySigma_s = 0.05;
constexpr double kImuSigma_rad = degToRad(3.0);
constexpr double kLaserSigma_m = 0.03;
constexpr double kLaserSigma_rad = degToRad(1.0);
constexpr double kMotion_s = 0.5;  // of the pairs of scans behind the laser's pose

struct Sensors {
  std::vector<Measurement> measurements;
  bool imu = false;
  bool gnss = false;
  bool laser = false;
};

Sensors read(
    const std::string& log,
    const io::RecordingOptions& options,
    const pipeline::Progress& progress) {
  Sensors s;
  const auto reader = io::openRecording(log, options);
  pipeline::forEachInStampOrder(
      *reader,
      [&s](const Measurement& m) {
        s.imu = s.imu || std::holds_alternative<Imu>(m);
        const auto* fix = std::get_if<GnssFix>(&m);
        s.gnss = s.gnss || (fix != nullptr && fix->type != GnssFixType::kNone);
        s.laser = s.laser || std::holds_alternative<LaserScan>(m);
        if (!std::holds_alternative<LaserScan>(m)) s.measurements.push_back(m);
      },
      progress);
  return s;
}

// --- antenna -------------------------------------------------------------------------------------

/// Fixes of a stretch that is short enough for odometry (wheels for the way, gyro for the turns) to
/// keep its shape and for the slow error of the fixes to stay the same.
struct Stretch {
  std::vector<Timestamp> stamps;
  std::vector<Eigen::Vector2d> fixes;
};

metrics::Trajectory odometryOf(const FilterLog& log, const pipeline::Config& config) {
  FilterReplay replay(config, log);
  metrics::Trajectory odometry;
  for (const Measurement& m : log.measurements) {
    (void)replay.feed(m);
    const auto* wheels = std::get_if<WheelOdometry>(&m);
    if (wheels == nullptr || replay.time() != wheels->stamp) continue;
    odometry.push_back({wheels->stamp, replay.odometry()});
  }
  return odometry;
}

/// At the ends the first and the last pose.
Pose2 poseAt(const metrics::Trajectory& path, Timestamp stamp) {
  const auto after = std::lower_bound(
      path.begin(), path.end(), stamp, [](const metrics::TimedPose& p, Timestamp t) {
        return p.stamp < t;
      });
  if (after == path.end()) return path.back().pose;
  if (after == path.begin()) return after->pose;
  const auto before = std::prev(after);
  const double span_s = toSeconds(after->stamp - before->stamp);
  return interpolate(before->pose, after->pose, toSeconds(stamp - before->stamp) / span_s);
}

std::vector<Stretch> stretchesOf(const FilterLog& log, const metrics::Trajectory& odometry) {
  // Short ones: what the wheels slip then stays in one of them.
  constexpr std::size_t kMostFixes = 20;
  constexpr std::size_t kFewestFixes = 8;
  constexpr double kLeastTravel_m = 1.0;
  std::vector<Stretch> all;
  Stretch now;
  double travel_m = 0.0;
  const auto close = [&] {
    if (now.stamps.size() >= kFewestFixes && travel_m >= kLeastTravel_m) {
      all.push_back(std::move(now));
    }
    now = {};
    travel_m = 0.0;
  };
  for (const Measurement& m : log.measurements) {
    const auto* fix = std::get_if<GnssFix>(&m);
    if (fix == nullptr || fix->type == GnssFixType::kNone) continue;
    if (now.stamps.size() == kMostFixes ||
        (!now.stamps.empty() && toSeconds(fix->stamp - now.stamps.front()) > kStretch_s)) {
      close();
    }
    if (!now.stamps.empty()) {
      const Pose2 moved =
          between(poseAt(odometry, now.stamps.back()), poseAt(odometry, fix->stamp));
      travel_m += translationNorm(moved) + 0.3 * std::abs(moved.phi);
    }
    now.stamps.push_back(fix->stamp);
    now.fixes.push_back(pipeline::antennaInMap(*fix, log.plane).head<2>());
  }
  close();
  return all;
}

enum ArmIndex { kArmX, kArmY, kDelay, kScale, kArmCount };

/// Fixes less where the antenna was by odometry, each stretch laid on its fixes as well as a rigid
/// motion can.
void appendMisfits(
    const Stretch& stretch,
    const metrics::Trajectory& odometry,
    const Eigen::VectorXd& p,
    std::vector<double>& misfits) {
  const auto n = static_cast<double>(stretch.stamps.size());
  std::vector<Eigen::Vector2d> antenna;
  Eigen::Vector2d mean_antenna = Eigen::Vector2d::Zero();
  Eigen::Vector2d mean_fix = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < stretch.stamps.size(); ++i) {
    // A stamp that is late belongs to an earlier moment.
    const Pose2 T = poseAt(odometry, stretch.stamps[i] - durationFromSeconds(p[kDelay]));
    const Point2 arm = transform({0, 0, T.phi}, {p[kArmX], p[kArmY]});
    antenna.emplace_back(p[kScale] * T.x + arm.x, p[kScale] * T.y + arm.y);
    mean_antenna += antenna.back() / n;
    mean_fix += stretch.fixes[i] / n;
  }
  double dot = 0.0;
  double cross = 0.0;
  for (std::size_t i = 0; i < antenna.size(); ++i) {
    const Eigen::Vector2d a = antenna[i] - mean_antenna;
    const Eigen::Vector2d b = stretch.fixes[i] - mean_fix;
    dot += a.dot(b);
    cross += a.x() * b.y() - a.y() * b.x();
  }
  const Eigen::Rotation2Dd R(std::atan2(cross, dot));
  for (std::size_t i = 0; i < antenna.size(); ++i) {
    const Eigen::Vector2d r = stretch.fixes[i] - mean_fix - R * (antenna[i] - mean_antenna);
    misfits.push_back(r.x());
    misfits.push_back(r.y());
  }
}

double rms(const std::vector<double>& r) {
  double sum = 0.0;
  for (const double x : r) sum += x * x;
  return r.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(r.size()));
}

}  // namespace

void calibrateAntenna(
    const FilterLog& log,
    const pipeline::Config& config,
    bool arm_known,
    Calibration& result,
    std::vector<std::pair<double, double>>* curve) {
  const Point2 before = config.rig.p_base_antenna;
  const metrics::Trajectory odometry = odometryOf(log, config);
  const std::vector<Stretch> stretches = stretchesOf(log, odometry);
  const auto misfits = [&](const Eigen::VectorXd& p) {
    std::vector<double> all;
    for (const Stretch& s : stretches) appendMisfits(s, odometry, p, all);
    return all;
  };
  const Eigen::Vector4d start(before.x, before.y, 0.0, 1.0);
  Fit fit;
  fit.parameters = start;
  fit.cov = Eigen::Matrix4d::Identity();
  if (!stretches.empty()) {
    std::vector<int> groups;
    for (std::size_t i = 0; i < stretches.size(); ++i) {
      groups.insert(
          groups.end(),
          2 * stretches[i].stamps.size(),
          groupAt(toSeconds(stretches[i].stamps.front() - log.first)));
    }
    const double arm_sigma_m = arm_known ? 1e-4 : 2.0;
    fit = robustFit(misfits, start, Eigen::Vector4d(arm_sigma_m, arm_sigma_m, 1.0, 0.2), groups);
    for (int i = -25; curve != nullptr && i <= 25; ++i) {
      Eigen::VectorXd p = fit.parameters;
      p[kDelay] += 0.02 * i;
      curve->emplace_back(p[kDelay], rms(misfits(p)) * std::sqrt(2.0));
    }
    Residuals residuals{"antenna", "m", {}, {}};
    for (const Stretch& stretch : stretches) {
      const double at_s = toSeconds(stretch.stamps.front() - log.first);
      const auto sizeWith = [&](const Eigen::VectorXd& p) {
        std::vector<double> r;
        appendMisfits(stretch, odometry, p, r);
        return rms(r) * std::sqrt(2.0);
      };
      residuals.before.emplace_back(at_s, sizeWith(start));
      residuals.after.emplace_back(at_s, sizeWith(fit.parameters));
    }
    result.residuals.push_back(std::move(residuals));
  }
  const std::string turns =
      "turn on the spot and drive eights under RTK: on straights the arm cannot be told from an "
      "offset of the map";
  const auto add = [&](const char* name, const char* unit, double was, int i, double limit) {
    Quantity q{name, unit, was, fit.parameters[i], std::sqrt(fit.cov(i, i)), ""};
    if (stretches.empty() || q.sigma > limit) q.unobserved = turns;
    result.quantities.push_back(q);
  };
  add(kAntennaX, "m", before.x, kArmX, kArmSigma_m);
  add(kAntennaY, "m", before.y, kArmY, kArmSigma_m);
  add(kGnssLate, "s", 0.0, kDelay, kDelaySigma_s);
}

namespace {

// --- IMU -----------------------------------------------------------------------------------------

/// Specific force along and across against what the wheels say: v' and v w. Both are averaged over
/// half a second, which leaves vibration out and any bias in.
void calibrateImu(
    const std::vector<Measurement>& measurements,
    const pipeline::Config& config,
    Calibration& result) {
  constexpr double kBin_s = 0.5;
  struct Bin {
    Eigen::Vector2d force = Eigen::Vector2d::Zero();
    double rate = 0.0;
    int imu = 0;
    double distance = 0.0;
    double time = 0.0;
  };
  std::vector<Bin> bins;
  const Timestamp first = stampOf(measurements.front());
  const auto binAt = [&](Timestamp stamp) -> Bin& {
    const double at = std::max(0.0, toSeconds(stamp - first));
    const auto i = static_cast<std::size_t>(at / kBin_s);
    if (i >= bins.size()) bins.resize(i + 1);
    return bins[i];
  };
  for (const Measurement& m : measurements) {
    if (const auto* imu = std::get_if<Imu>(&m)) {
      Bin& b = binAt(imu->stamp);
      b.force += imu->accel_mps2.head<2>();
      b.rate += imu->omega_radps.z();
      ++b.imu;
    } else if (const auto* wheels = std::get_if<WheelOdometry>(&m)) {
      Bin& b = binAt(wheels->stamp);
      b.distance += logSe2(wheels->T_previous_now).x();
      b.time += wheels->dt_s;
    }
  }
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> rows;  // expected, measured
  std::vector<int> groups;
  for (std::size_t i = 1; i + 1 < bins.size(); ++i) {
    const Bin& b = bins[i];
    if (b.imu == 0 || b.time <= 0.0 || bins[i - 1].time <= 0.0 || bins[i + 1].time <= 0.0) continue;
    const double v = b.distance / b.time;
    const double v_before = bins[i - 1].distance / bins[i - 1].time;
    const double v_after = bins[i + 1].distance / bins[i + 1].time;
    const double a = (v_after - v_before) / (2.0 * kBin_s);
    rows.emplace_back(Eigen::Vector2d(a, v * b.rate / b.imu), b.force / b.imu);
    groups.insert(groups.end(), 2, groupAt(kBin_s * static_cast<double>(i)));
  }
  const auto misfits = [&](const Eigen::VectorXd& p) {
    // The IMU's axes are turned by p[0] from the robot's: it sees the robot's force turned back.
    const double c = std::cos(p[0]);
    const double s = std::sin(p[0]);
    std::vector<double> r;
    for (const auto& [e, f] : rows) {
      r.push_back(f.x() - (c * e.x() + s * e.y()) - p[1]);
      r.push_back(f.y() - (-s * e.x() + c * e.y()) - p[2]);
    }
    return r;
  };
  Fit fit;
  if (!rows.empty()) {
    fit = robustFit(misfits, Eigen::Vector3d::Zero(), Eigen::Vector3d(2.0, 1.0, 1.0), groups);
  }
  Quantity q{"IMU yaw", "deg", radToDeg(config.rig.imu_yaw_rad), 0.0, 0.0, ""};
  if (rows.empty()) {
    q.unobserved = "no accelerations beside wheel messages in the recording";
  } else {
    // Recorded IMU data come in base axes by the present mounting: the rest is what it is off by.
    q.value = q.before + radToDeg(fit.parameters[0]);
    q.sigma = radToDeg(std::sqrt(fit.cov(0, 0)));
    if (q.sigma > radToDeg(kImuSigma_rad)) {
      q.unobserved = "start and stop briskly, ten times, or drive fast curves";
    }
  }
  result.quantities.push_back(q);
}

// --- laser ---------------------------------------------------------------------------------------

/// Motion of the laser by matching scans, against a base that neither slides sideways nor moves
/// otherwise than its wheels say.
void calibrateLaser(
    const std::string& log,
    const io::RecordingOptions& options,
    const pipeline::Config& config,
    const std::vector<Measurement>& measurements,
    Calibration& result,
    const pipeline::Progress& progress) {
  const pipeline::MapDriveResult mapped =
      pipeline::mapDrive(log, options, {}, config, Observers{}, progress);
  const auto reader = io::openRecording(log, options);
  while (reader->next()) {
  }
  const Pose2 T_base_laser = reader->rig().T_base_laser;
  metrics::Trajectory wheels;
  Pose2 T;
  for (const Measurement& m : measurements) {
    const auto* w = std::get_if<WheelOdometry>(&m);
    if (w == nullptr) continue;
    T = compose(T, w->T_previous_now);
    wheels.push_back({w->stamp, T});
  }
  metrics::AssociationOptions association;
  association.matching = metrics::Matching::kInterpolated;
  association.max_dt = std::chrono::milliseconds(200);
  const auto matches = metrics::associate(mapped.trajectory, wheels, association);
  struct Motion {
    Pose2 T_laser;    ///< by the scans
    double wheels_m;  ///< forward, by the wheels
    double at_s;
  };
  std::vector<Motion> motions;
  for (std::size_t i = 0, j = 0; i < matches.size(); i = j) {
    j = i + 1;
    while (j < matches.size() && toSeconds(matches[j].stamp - matches[i].stamp) < kMotion_s) ++j;
    if (j >= matches.size()) break;
    const double dt = toSeconds(matches[j].stamp - matches[i].stamp);
    if (dt <= 0.0 || dt > 4.0 * kMotion_s) continue;
    const Pose2 T_a = compose(matches[i].estimate, T_base_laser);
    const Pose2 T_b = compose(matches[j].estimate, T_base_laser);
    motions.push_back(
        {between(T_a, T_b),
         logSe2(between(matches[i].reference, matches[j].reference)).x(),
         toSeconds(matches[i].stamp - matches.front().stamp)});
  }
  // x, y, yaw of the laser and the scale of the wheels.
  const Eigen::Vector4d start(T_base_laser.x, T_base_laser.y, T_base_laser.phi, 1.0);
  const auto errorAt = [](const Motion& m, const Eigen::VectorXd& p) {
    const Pose2 mount(p[0], p[1], p[2]);
    const Eigen::Vector3d twist = logSe2(compose(compose(mount, m.T_laser), inverse(mount)));
    return Eigen::Vector2d(twist.x() - p[3] * m.wheels_m, twist.y());
  };
  const auto misfits = [&](const Eigen::VectorXd& p) {
    std::vector<double> r;
    for (const Motion& m : motions) {
      const Eigen::Vector2d e = errorAt(m, p);
      r.insert(r.end(), {e.x(), e.y()});
    }
    return r;
  };
  Fit fit;
  fit.parameters = start;
  if (motions.size() > 8) {
    std::vector<int> groups;
    for (const Motion& m : motions) groups.insert(groups.end(), 2, groupAt(m.at_s));
    fit = robustFit(misfits, start, Eigen::Vector4d(1.0, 1.0, 1.0, 0.3), groups);
  }
  const bool fitted = fit.cov.size() > 0;
  const auto add = [&](const char* name,
                       const char* unit,
                       int i,
                       double factor,
                       double limit,
                       const char* drive) {
    Quantity q{name, unit, start[i] * factor, fit.parameters[i] * factor, 0.0, ""};
    if (fitted) q.sigma = std::sqrt(fit.cov(i, i)) * factor;
    if (!fitted || q.sigma > limit * factor) q.unobserved = drive;
    result.quantities.push_back(q);
  };
  const char* turns = "turn on the spot, both ways, beside walls";
  const char* straight = "drive straight for 10 m beside walls";
  add("laser x", "m", 0, 1.0, kLaserSigma_m, turns);
  add("laser y", "m", 1, 1.0, kLaserSigma_m, turns);
  add("laser yaw", "deg", 2, radToDeg(1.0), kLaserSigma_rad, straight);
  if (!fitted) return;
  Residuals residuals{"laser", "m", {}, {}};
  for (const Motion& m : motions) {
    residuals.before.emplace_back(m.at_s, errorAt(m, start).norm());
    residuals.after.emplace_back(m.at_s, errorAt(m, fit.parameters).norm());
  }
  result.residuals.push_back(std::move(residuals));
}

void unobservable(
    Calibration& result, std::initializer_list<const char*> names, const std::string& why) {
  for (const char* name : names) result.quantities.push_back({name, "", 0.0, 0.0, 0.0, why});
}

}  // namespace

Calibration calibrateMount(
    const std::string& log,
    const io::RecordingOptions& options,
    const pipeline::Config& config,
    const pipeline::Progress& progress) {
  const Sensors sensors = read(log, options, progress);
  if (sensors.measurements.empty() ||
      std::none_of(sensors.measurements.begin(), sensors.measurements.end(), [](const auto& m) {
        return std::holds_alternative<WheelOdometry>(m);
      })) {
    throw InputError(log + ": no wheel odometry in it (see vestibule info)");
  }
  Calibration result;
  if (sensors.gnss) {
    calibrateAntenna(makeFilterLog(sensors.measurements), config, false, result);
  } else {
    unobservable(result, {kAntennaX, kAntennaY, kGnssLate}, "no GNSS fixes in the recording");
  }
  if (sensors.imu) {
    calibrateImu(sensors.measurements, config, result);
  } else {
    unobservable(result, {"IMU yaw"}, "no IMU in the recording");
  }
  if (sensors.laser) {
    calibrateLaser(log, options, config, sensors.measurements, result, progress);
  } else {
    unobservable(result, {"laser x", "laser y", "laser yaw"}, "no laser scans in the recording");
  }
  return result;
}

}  // namespace vestibule::tuning
