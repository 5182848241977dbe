#include "vestibule/pipeline/fuse.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "fuse_words.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/ekf/smoother.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/metrics/transition.hpp"
#include "vestibule/pipeline/gnss_input.hpp"
#include "vestibule/pipeline/time_ordered_queue.hpp"

namespace vestibule::pipeline {
namespace {

/// What the filter takes from a recording, in stamp order.
struct Log {
  std::vector<Measurement> measurements;
  std::vector<std::string> notes;
  Timestamp first;
  Timestamp last;
};

Log readLog(
    const std::string& path, const io::RecordingOptions& options, const Progress& progress) {
  const auto reader = io::openRecording(path, options);
  Log log;
  std::size_t wheels = 0;
  forEachInStampOrder(
      *reader,
      [&](const Measurement& measurement) {
        if (std::holds_alternative<LaserScan>(measurement)) return;
        if (std::holds_alternative<WheelOdometry>(measurement)) ++wheels;
        log.measurements.push_back(measurement);
      },
      progress);
  if (wheels == 0) {
    throw InputError(
        path + ": no wheel odometry in it, which the filter needs (see vestibule info)");
  }
  log.notes = reader->notes();
  log.first = log.last = stampOf(log.measurements.front());
  for (const Measurement& m : log.measurements) {
    log.first = std::min(log.first, stampOf(m));
    log.last = std::max(log.last, stampOf(m));
  }
  return log;
}

/// With the stamps of some sensor set back, in their order again.
template <class IsIt>
std::vector<Measurement> earlier(
    std::vector<Measurement> measurements, double by_s, const IsIt& is_it) {
  for (Measurement& m : measurements) {
    if (!is_it(m)) continue;
    std::visit([&](auto& x) { x.stamp = x.stamp - durationFromSeconds(by_s); }, m);
  }
  std::stable_sort(measurements.begin(), measurements.end(), [](const auto& a, const auto& b) {
    return stampOf(a) < stampOf(b);
  });
  return measurements;
}

/// The configured datum, or the mean of the fixes of the first seconds with any. Empty for local
/// metres.
std::optional<Datum> datumOf(const Log& log, const DatumParams& params) {
  if (params.position) return Datum{*params.position, 0.0, 0};
  std::vector<Geodetic> fixes;
  double reported_var = 0.0;
  std::optional<Timestamp> since;
  for (const Measurement& m : log.measurements) {
    const auto* fix = std::get_if<GnssFix>(&m);
    if (fix == nullptr || fix->type == GnssFixType::kNone) continue;
    const auto* geodetic = std::get_if<Geodetic>(&fix->position);
    if (geodetic == nullptr) return std::nullopt;
    if (!since) since = fix->stamp;
    if (toSeconds(fix->stamp - *since) > params.average_s) break;
    fixes.push_back(*geodetic);
    if (fix->cov_enu) reported_var += 0.5 * fix->cov_enu->topLeftCorner<2, 2>().trace();
  }
  if (fixes.empty()) return std::nullopt;
  // The mean in a plane at the first: longitudes may wrap.
  const geo::TangentPlane plane(fixes.front());
  const auto n = static_cast<double>(fixes.size());
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Geodetic& g : fixes) mean += plane.toEnu(g) / n;
  double spread = 0.0;
  for (const Geodetic& g : fixes) spread += (plane.toEnu(g) - mean).head<2>().squaredNorm() / n;
  // What the receiver claims lasts for minutes and does not average out.
  return Datum{
      plane.toGeodetic(mean), std::sqrt(reported_var / n + 0.5 * spread / n), fixes.size()};
}

std::optional<geo::TangentPlane> planeAt(const std::optional<Datum>& datum) {
  if (!datum) return std::nullopt;
  return geo::TangentPlane(datum->position);
}

/// Hands a measurement to a filter, fixes in the map frame.
ekf::UpdateReport feed(
    ekf::MapFilter& filter,
    const Measurement& measurement,
    const std::optional<geo::TangentPlane>& plane) {
  if (const auto* wheels = std::get_if<WheelOdometry>(&measurement)) return filter.process(*wheels);
  if (const auto* imu = std::get_if<Imu>(&measurement)) return filter.process(*imu);
  if (const auto* heading = std::get_if<Heading>(&measurement)) return filter.process(*heading);
  const auto& fix = std::get<GnssFix>(measurement);
  if (fix.type == GnssFixType::kNone) return filter.process(inMap(fix, Eigen::Vector3d::Zero()));
  return filter.process(inMap(fix, antennaInMap(fix, plane)));
}

/// One recording on its way through the filter.
class Fusion {
 public:
  Fusion(
      const Config& config, const FuseOptions& options, const Log& log, const Observers& observers)
      : options_(options),
        observers_(observers),
        filter_(config.ekf, config.rig, &observers),
        words_(log.first) {
    result.datum = datumOf(log, config.datum);
    plane_ = planeAt(result.datum);
    result.notes = log.notes;
    result.data_s = toSeconds(log.last - log.first);
    trust_heading_ = config.ekf.init.trust_heading;
    for (const Measurement& m : log.measurements) {
      process(m);
      if (!result.ready_after_s && filter_.ready()) {
        result.ready_after_s = toSeconds(filter_.time() - log.first);
        placeHeldBack(filter_.initialAlignment()->mean, filter_.initialAlignment()->cov);
        if (options_.smooth) filter_.record(&smoother_);
      }
    }
    finish();
  }

  FuseResult result;

 private:
  void process(const Measurement& measurement) {
    const bool was_ready = filter_.ready();
    const Pose2 before = was_ready ? filter_.pose().mean : Pose2();
    const ekf::UpdateReport report = feed(filter_, measurement, plane_);
    if (const auto* fix = std::get_if<GnssFix>(&measurement)) {
      if (fix->type == GnssFixType::kNone) return;
      const Eigen::Vector3d p = antennaInMap(*fix, plane_);
      result.fixes.push_back({p.x(), p.y()});
      (wasUsed(report) ? result.fixes_accepted : result.fixes_refused) += 1;
      if (report.reason == "reset") ++result.position_resets;
      const double moved_m = was_ready ? distance(before, filter_.pose().mean) : 0.0;
      words_.fix(fix->stamp, p.head<2>(), report, moved_m);
    } else if (const auto* heading = std::get_if<Heading>(&measurement)) {
      if (!first_yaw_ && (trust_heading_ || heading->offset_sigma_rad)) {
        first_yaw_ = heading->yaw_rad;
      }
      words_.heading(heading->stamp, report);
    } else if (const auto* wheels = std::get_if<WheelOdometry>(&measurement)) {
      if (filter_.time() == wheels->stamp) output();
    }
  }

  void output() {
    const PoseWithCovariance T_odom_base = filter_.odometry();
    const Timestamp stamp = filter_.time();
    result.odometry.push_back({stamp, T_odom_base.mean});
    if (!filter_.ready()) {
      held_back_.push_back({stamp, filter_.odometryState().pose3(), T_odom_base});
      return;
    }
    const ekf::State& x = filter_.state();
    const ekf::StateMatrix& P = filter_.covariance();
    const auto sigma = [&P](int i) { return std::sqrt(std::max(0.0, P(i, i))); };
    result.samples.push_back(
        {stamp,
         filter_.standstill() ? 0.0 : filter_.speed() * std::exp(x.wheel_scale),
         x.yaw(),
         x.gyro_bias.z(),
         sigma(ekf::kGyroBias + 2),
         x.wheel_scale,
         sigma(ekf::kWheelScale)});
    append(stamp, x.pose3(), filter_.pose());
    if (options_.smooth) smoother_.mark(stamp, x, P);
  }

  /// Odometry from before the filter was ready gets its place in the map.
  void placeHeldBack(const Pose2& T_map_odom, const Eigen::Matrix3d& cov) {
    for (const HeldBack& h : held_back_) {
      PoseWithCovariance T_map_base =
          compose(PoseWithCovariance{T_map_odom, cov}, h.T_odom_base.mean);
      T_map_base.cov += compose(T_map_odom, h.T_odom_base).cov;
      append(h.stamp, placed(h.T, T_map_base.mean), T_map_base);
    }
    held_back_.clear();
  }

  /// Height, roll and pitch of `T` at the place `T_map_base`.
  static Pose3 placed(Pose3 T, const Pose2& T_map_base) {
    T.x = T_map_base.x;
    T.y = T_map_base.y;
    T.yaw = T_map_base.phi;
    return T;
  }

  void append(Timestamp stamp, const Pose3& T, const PoseWithCovariance& T_map_base) {
    result.trajectory.push_back({stamp, T_map_base.mean});
    result.poses.push_back({stamp, T});
    covariances_.push_back(T_map_base.cov);
    if (!options_.smooth) emit(stamp, T_map_base);
  }

  void emit(Timestamp stamp, const PoseWithCovariance& T_map_base) const {
    PoseEvent event;
    event.stamp = stamp;
    event.source = PoseSource::kGnssFilter;
    event.T = T_map_base;
    observers_.emit(event);
  }

  void finish() {
    result.waiting_for = filter_.waitingFor();
    result.dropped = filter_.dropped();
    if (!result.ready_after_s) {
      // Without any fix the odometry frame is all there is; a trusted heading turns it to the
      // north.
      placeHeldBack(Pose2(0, 0, first_yaw_.value_or(0.0)), Eigen::Matrix3d::Zero());
    }
    if (options_.smooth) smooth();
    for (std::size_t i = 1; i < result.trajectory.size(); ++i) {
      result.distance_m += distance(result.trajectory[i - 1].pose, result.trajectory[i].pose);
    }
    result.largest_jump_m = metrics::largestJump(result.trajectory).position_m;
    if (result.ready_after_s && result.fixes.size() >= 2 && result.trajectory.size() >= 2) {
      const Pose2& a = result.trajectory.front().pose;
      const Pose2& b = result.trajectory.back().pose;
      const Point2& fa = result.fixes.front();
      const Point2& fb = result.fixes.back();
      result.gnss_gap_m = std::hypot((b.x - a.x) - (fb.x - fa.x), (b.y - a.y) - (fb.y - fa.y));
    }
    result.stood_out = words_.text();
    if (filter_.ready()) {
      const auto about = aboutSensors(filter_.state(), filter_.covariance());
      result.stood_out.insert(result.stood_out.end(), about.begin(), about.end());
    }
  }

  void smooth() {
    result.filtered = result.trajectory;
    const auto smoothed = smoother_.smooth();
    const std::size_t before = result.trajectory.size() - smoothed.size();
    std::vector<double> moved_m;
    for (std::size_t i = 0; i < smoothed.size(); ++i) {
      set(before + i, smoothed[i].x.pose3(), smoothed[i].x.pose2());
      const int index[3] = {ekf::kPos, ekf::kPos + 1, ekf::kAtt + 2};
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c)
          covariances_[before + i](r, c) = smoothed[i].P(index[r], index[c]);
      }
    }
    // The way to the first smoothed pose is that of the odometry.
    if (before > 0 && !smoothed.empty()) {
      const Pose2 T_map_odom =
          compose(smoothed.front().x.pose2(), inverse(result.odometry[before].pose));
      for (std::size_t i = 0; i < before; ++i) {
        set(i, result.poses[i].T, compose(T_map_odom, result.odometry[i].pose));
      }
    }
    for (std::size_t i = 0; i < result.trajectory.size(); ++i) {
      moved_m.push_back(distance(result.filtered[i].pose, result.trajectory[i].pose));
      emit(result.trajectory[i].stamp, {result.trajectory[i].pose, covariances_[i]});
    }
    if (!moved_m.empty()) result.smoothing_m = metrics::statistics(moved_m);
  }

  void set(std::size_t i, const Pose3& T, const Pose2& T_map_base) {
    result.trajectory[i].pose = T_map_base;
    result.poses[i].T = placed(T, T_map_base);
  }

  struct HeldBack {
    Timestamp stamp;
    Pose3 T;
    PoseWithCovariance T_odom_base;
  };

  FuseOptions options_;
  const Observers& observers_;
  ekf::MapFilter filter_;
  ekf::Smoother smoother_;
  FuseWords words_;
  std::optional<geo::TangentPlane> plane_;
  bool trust_heading_ = false;
  std::optional<double> first_yaw_;
  std::vector<HeldBack> held_back_;
  std::vector<Eigen::Matrix3d> covariances_;  // of result.trajectory
};

}  // namespace

FuseResult fuse(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const Config& config,
    const FuseOptions& options,
    const Observers& observers,
    const Progress& progress) {
  Log log = readLog(recording_path, recording_options, progress);
  if (options.gnss_late_s != 0.0) {
    log.measurements =
        earlier(std::move(log.measurements), options.gnss_late_s, [](const Measurement& m) {
          return std::holds_alternative<GnssFix>(m);
        });
  }
  return std::move(Fusion(config, options, log, observers).result);
}

std::vector<Outage> hiddenOutages(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const Config& config,
    double length_s,
    const Progress& progress) {
  constexpr double kEvery_s = 10.0;
  const Log log = readLog(recording_path, recording_options, [](double, double) {});
  const auto plane = planeAt(datumOf(log, config.datum));
  const double data_s = toSeconds(log.last - log.first);
  std::vector<Outage> outages;
  for (double start_s = kEvery_s; start_s + length_s <= data_s; start_s += kEvery_s) {
    const Timestamp from = log.first + durationFromSeconds(start_s);
    const Timestamp to = from + durationFromSeconds(length_s);
    ekf::MapFilter filter(config.ekf, config.rig);
    Outage outage;
    outage.start_s = start_s;
    std::optional<Pose2> at_start;
    std::optional<Outage> measured;
    for (const Measurement& m : log.measurements) {
      const Timestamp stamp = stampOf(m);
      if (stamp >= to) break;
      const auto* fix = std::get_if<GnssFix>(&m);
      if (fix == nullptr || stamp < from) {
        (void)feed(filter, m, plane);
        continue;
      }
      if (!filter.ready() || fix->type == GnssFixType::kNone) continue;
      if (!at_start) at_start = filter.pose().mean;
      const Eigen::Vector3d p = antennaInMap(*fix, plane);
      const auto expected = filter.expected(inMap(*fix, p));
      const Eigen::Vector2d miss = p.head<2>() - expected.p_map_antenna;
      outage.error_m = miss.norm();
      outage.covered =
          miss.dot(expected.cov.inverse() * miss) <= metrics::chiSquareQuantile(0.95, 2);
      outage.travel_m = distance(*at_start, filter.pose().mean);
      // A window whose last fix is far from its end says nothing about the end.
      if (toSeconds(to - stamp) < 0.1 * length_s) measured = outage;
    }
    if (measured) outages.push_back(*measured);
    progress(start_s / data_s, start_s);
  }
  return outages;
}

namespace {

bool isOf(const Measurement& m, const std::string& sensor) {
  return sensor == "gnss"      ? std::holds_alternative<GnssFix>(m)
         : sensor == "heading" ? std::holds_alternative<Heading>(m)
                               : std::holds_alternative<WheelOdometry>(m);
}

/// Innovations of one such stretch may depend on each other in any way.
constexpr double kStretch_s = 20.0;

/// Minus twice the logarithm of the likelihood of the innovations of every stretch, outliers
/// counted as if they lay on the gate.
Eigen::VectorXd misfits(
    const Log& log,
    const Config& config,
    const std::optional<geo::TangentPlane>& plane,
    const std::string& sensor,
    double offset_s) {
  const std::vector<Measurement> shifted =
      earlier(log.measurements, offset_s, [&](const Measurement& m) { return isOf(m, sensor); });
  ekf::MapFilter filter(config.ekf, config.rig);
  Eigen::VectorXd sums = Eigen::VectorXd::Zero(
      1 + static_cast<Eigen::Index>(toSeconds(log.last - log.first) / kStretch_s));
  for (const Measurement& m : shifted) {
    const ekf::UpdateReport report = feed(filter, m, plane);
    if (report.dof == 0) continue;
    const double at_s = std::max(0.0, toSeconds(stampOf(m) - log.first));
    const auto stretch = static_cast<Eigen::Index>(at_s / kStretch_s);
    sums[std::min(stretch, sums.size() - 1)] += std::min(report.nis, report.gate) + report.log_det;
  }
  return sums;
}

/// Of the least of a parabola through three misfits: by its curvature, or by the scatter of the
/// stretches' slopes where that is more.
double sigmaOfLeast(
    const Eigen::VectorXd& left, const Eigen::VectorXd& right, double curvature, double step_s) {
  const Eigen::ArrayXd slopes = (right - left).array() / (2.0 * step_s);
  if (slopes.size() < 2) return std::sqrt(2.0 / curvature);
  const auto n = static_cast<double>(slopes.size());
  const double scatter = n / (n - 1.0) * (slopes - slopes.mean()).square().sum();
  return std::sqrt(std::max(2.0 / curvature, scatter / (curvature * curvature)));
}

StampOffset offsetOf(
    const std::string& sensor,
    const Log& log,
    const Config& config,
    const std::function<void(double)>& progress) {
  constexpr double kReach_s = 1.5;
  const auto plane = planeAt(datumOf(log, config.datum));
  StampOffset best{sensor, 0.0, 0.0, false, {}};
  double step_s = 0.25;
  double centre_s = 0.0;
  double reach_s = kReach_s;
  // Coarse to fine: the neighbours of the best are searched again with a fifth of the step.
  for (int level = 0; level < 3; ++level) {
    double lowest = std::numeric_limits<double>::infinity();
    double at_s = centre_s;
    for (double d = -reach_s; d <= reach_s + 1e-9; d += step_s) {
      const double value = misfits(log, config, plane, sensor, centre_s + d).sum();
      best.misfits.emplace_back(centre_s + d, value);
      if (value < lowest) {
        lowest = value;
        at_s = centre_s + d;
      }
    }
    const Eigen::VectorXd left = misfits(log, config, plane, sensor, at_s - step_s);
    const Eigen::VectorXd right = misfits(log, config, plane, sensor, at_s + step_s);
    const double bend = left.sum() - 2.0 * lowest + right.sum();
    centre_s = at_s;
    best.offset_s = at_s;
    best.found = bend > 0.0 && std::abs(at_s) < kReach_s;
    if (bend > 0.0) {
      best.offset_s = at_s - 0.5 * step_s * (right.sum() - left.sum()) / bend;
      best.sigma_s = sigmaOfLeast(left, right, bend / (step_s * step_s), step_s);
    }
    reach_s = step_s;
    step_s /= 5.0;
    progress((level + 1) / 3.0);
  }
  std::sort(best.misfits.begin(), best.misfits.end());
  const auto least =
      std::min_element(best.misfits.begin(), best.misfits.end(), [](const auto& a, const auto& b) {
        return a.second < b.second;
      });
  const double least_value = least->second;
  for (auto& [offset_s, value] : best.misfits) value -= least_value;
  return best;
}

}  // namespace

std::vector<StampOffset> estimateOffsets(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const Config& config,
    const std::map<std::string, double>& known_s,
    const Progress& progress) {
  Log log = readLog(recording_path, recording_options, [](double, double) {});
  for (const auto& [sensor, late_s] : known_s) {
    log.measurements =
        earlier(std::move(log.measurements), late_s, [&of = sensor](const Measurement& m) {
          return isOf(m, of);
        });
  }
  std::vector<StampOffset> result;
  const std::vector<std::string> sensors{"gnss", "heading", "wheels"};
  for (std::size_t s = 0; s < sensors.size(); ++s) {
    if (known_s.count(sensors[s]) > 0 ||
        std::none_of(log.measurements.begin(), log.measurements.end(), [&](const Measurement& m) {
          return isOf(m, sensors[s]);
        })) {
      continue;
    }
    result.push_back(offsetOf(sensors[s], log, config, [&](double share) {
      progress((static_cast<double>(s) + share) / static_cast<double>(sensors.size()), 0.0);
    }));
  }
  return result;
}

}  // namespace vestibule::pipeline
