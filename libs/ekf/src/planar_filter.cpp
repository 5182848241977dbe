#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "alignment.hpp"
#include "gnss_screen.hpp"
#include "odometry_core.hpp"
#include "vestibule/core/angles.hpp"

namespace vestibule::ekf {
namespace {

/// A fix may be this late: it is carried on by the present speed.
constexpr double kMaxGnssDelay_s = 0.5;
/// A heading reading is of use for starting up for this long.
constexpr double kHeadingAge_s = 1.0;

UpdateReport rejected(const std::string& reason) {
  UpdateReport report;
  report.decision = Decision::kRejected;
  report.reason = reason;
  return report;
}

}  // namespace

struct PlanarFilter::Impl {
  Impl(const FilterParams& p, const SensorRig& r, const Observers* o)
      : params(p),
        rig(r),
        observers(o),
        odometry(p),
        core(*odometry.core_),
        tracker(p, Tracker::Pose::kCorrected),
        alignment(p),
        realignment(p),
        screen(p, r.p_base_antenna) {}

  UpdateReport tell(Timestamp stamp, const char* sensor, UpdateReport report) const {
    if (observers != nullptr) {
      observers->emit(UpdateEvent{
          stamp, sensor, report.decision, report.reason, report.nis, report.gate, report.dof});
    }
    return report;
  }

  void take(const std::optional<Motion>& step) {
    if (step && ready) tracker.step(*step);
  }

  void begin(const PoseWithCovariance& T_map_base) {
    const Tracker& known = ready ? tracker : core.tracker;
    tracker.start(T_map_base, known.marginal(kGyroBias), known.marginal(kWheelScale));
    if (!ready) {
      initial_alignment = compose(T_map_base, inverse(core.tracker.pose().mean));
    }
    ready = true;
    screen.forget();
    if (heading && toSeconds(core.reckoning.time() - heading->stamp) < kHeadingAge_s) {
      (void)tracker.offerHeading(*heading);
    }
  }

  UpdateReport initialise(
      Timestamp stamp, const Eigen::Vector2d& p_map_antenna, const GnssScreen::Worth& worth);
  UpdateReport fuse(
      Timestamp stamp, const Eigen::Vector2d& p_map_antenna, const GnssScreen::Worth& worth);
  /// Tries to find the pose again from fixes that were all refused.
  bool recover(
      Timestamp stamp, const Eigen::Vector2d& p_map_antenna, const GnssScreen::Worth& worth);
  /// Starts from the odometry track aligned to the fixes.
  void begin(const TrackAlignment::Result& found);
  void trustGnss(Timestamp stamp) {
    screen.accepted(stamp);
    realignment = TrackAlignment(params);
    refused_since.reset();
  }

  FilterParams params;
  SensorRig rig;
  const Observers* observers;
  OdometryFilter odometry;
  OdometryFilter::Core& core;
  Tracker tracker;
  TrackAlignment alignment;    ///< from the start until ready
  TrackAlignment realignment;  ///< of fixes refused in a row
  std::optional<Timestamp> refused_since;
  GnssScreen screen;
  bool ready = false;
  std::optional<Heading> heading;
  std::optional<PoseWithCovariance> initial_alignment;
};

void PlanarFilter::Impl::begin(const TrackAlignment::Result& found) {
  PoseWithCovariance T;
  T.mean = compose(found.T_map_odom, core.tracker.pose().mean);
  const double position_var = found.position_sigma_m * found.position_sigma_m;
  T.cov.diagonal() << position_var, position_var, found.yaw_sigma_rad * found.yaw_sigma_rad;
  begin(T);
}

UpdateReport PlanarFilter::Impl::initialise(
    Timestamp stamp, const Eigen::Vector2d& p_map_antenna, const GnssScreen::Worth& worth) {
  UpdateReport report = rejected("not ready");
  const Pose2 T_odom_base = core.tracker.pose().mean;
  if (params.init.trust_heading && heading &&
      std::abs(toSeconds(stamp - heading->stamp)) < kHeadingAge_s) {
    const double sigma = std::max(heading->sigma_rad.value_or(0.0), params.heading.sigma_rad);
    const Point2 lever = transform(Pose2(0, 0, heading->yaw_rad), rig.p_base_antenna);
    PoseWithCovariance T;
    T.mean = Pose2(p_map_antenna.x() - lever.x, p_map_antenna.y() - lever.y, heading->yaw_rad);
    T.cov.topLeftCorner<2, 2>() = worth.R;
    T.cov(2, 2) = sigma * sigma + params.heading.offset_sigma_rad * params.heading.offset_sigma_rad;
    begin(T);
  } else {
    alignment.add(stamp, p_map_antenna, transform(T_odom_base, rig.p_base_antenna), worth.sigma_m);
    const auto found = alignment.solve();
    if (!found) return report;
    begin(*found);
  }
  screen.accepted(stamp);
  report.decision = Decision::kAccepted;
  report.reason = "initialised";
  return report;
}

UpdateReport PlanarFilter::Impl::fuse(
    Timestamp stamp, const Eigen::Vector2d& p_map_antenna, const GnssScreen::Worth& worth) {
  const Observation z =
      PlanarModel::gnss(tracker.state(), p_map_antenna, rig.p_base_antenna, worth.R);
  UpdateReport report = tracker.offer(z, worth.inflation);
  if (report.decision != Decision::kGated) {
    trustGnss(stamp);
  } else if (recover(stamp, p_map_antenna, worth)) {
    trustGnss(stamp);
    report.decision = Decision::kAccepted;
    report.reason = "reset";
  }
  return report;
}

bool PlanarFilter::Impl::recover(
    Timestamp stamp, const Eigen::Vector2d& p_map_antenna, const GnssScreen::Worth& worth) {
  const Pose2 T_odom_base = core.tracker.pose().mean;
  const auto cluster =
      screen.refused(stamp, p_map_antenna, worth.sigma_m, T_odom_base, tracker.state()[kYaw]);
  if (cluster) {
    tracker.resetPosition(cluster->p_map_base, cluster->cov);
    return true;
  }
  if (!refused_since) refused_since = stamp;
  realignment.add(stamp, p_map_antenna, transform(T_odom_base, rig.p_base_antenna), worth.sigma_m);
  if (toSeconds(stamp - *refused_since) < params.recovery.realign_after_s ||
      realignment.extent() < params.recovery.min_travel_m) {
    return false;
  }
  const auto found = realignment.solve();
  if (!found) return false;
  begin(*found);
  return true;
}

PlanarFilter::PlanarFilter(
    const FilterParams& params, const SensorRig& rig, const Observers* observers)
    : impl_(std::make_unique<Impl>(params, rig, observers)) {}
PlanarFilter::~PlanarFilter() = default;

void PlanarFilter::process(const WheelOdometry& wheels) {
  impl_->take(impl_->core.process(wheels));
}

void PlanarFilter::process(const Imu& imu) {
  impl_->take(impl_->core.process(imu));
  const auto interval_s = impl_->core.zeroRateInterval();
  if (impl_->ready && interval_s)
    impl_->tracker.zeroRate(impl_->core.reckoning.rate(), *interval_s);
}

UpdateReport PlanarFilter::process(const Heading& heading) {
  Impl& f = *impl_;
  if (!std::isfinite(heading.yaw_rad) || !std::isfinite(heading.sigma_rad.value_or(0.0))) {
    ++f.core.dropped.not_finite;
    return f.tell(heading.stamp, "heading", rejected("not finite"));
  }
  const auto step = f.core.advance(heading.stamp);
  if (!step) return f.tell(heading.stamp, "heading", rejected("stale"));
  f.take(step);
  f.core.update(heading);
  f.heading = heading;
  if (!f.ready) return f.tell(heading.stamp, "heading", rejected("not ready"));
  return f.tell(heading.stamp, "heading", f.tracker.offerHeading(heading));
}

UpdateReport PlanarFilter::processGnss(
    Timestamp stamp,
    const Eigen::Vector2d& p_map_antenna,
    const std::optional<Eigen::Matrix2d>& cov,
    GnssFixType type,
    std::optional<double> hdop,
    std::optional<int> satellites) {
  Impl& f = *impl_;
  if (type != GnssFixType::kNone && !p_map_antenna.allFinite()) {
    ++f.core.dropped.not_finite;
    return f.tell(stamp, "gnss", rejected("not finite"));
  }
  Eigen::Vector2d p = p_map_antenna;
  if (f.core.reckoning.stale(stamp)) {
    const double late_s = toSeconds(f.core.reckoning.time() - stamp);
    if (late_s > kMaxGnssDelay_s) {
      ++f.core.dropped.stale;
      return f.tell(stamp, "gnss", rejected("stale"));
    }
    if (f.ready) {
      const double yaw = f.tracker.state()[kYaw] - 0.5 * late_s * yawRate();
      p += speed() * late_s * Eigen::Vector2d(std::cos(yaw), std::sin(yaw));
    }
  } else {
    f.take(f.core.advance(stamp));
  }
  const GnssScreen::Worth worth = f.screen.assess(stamp, cov, type, hdop, satellites);
  if (!worth.refused.empty()) return f.tell(stamp, "gnss", rejected(worth.refused));
  return f.tell(stamp, "gnss", f.ready ? f.fuse(stamp, p, worth) : f.initialise(stamp, p, worth));
}

UpdateReport PlanarFilter::processExternalPose(
    Timestamp stamp, const PoseWithCovariance& T_map_base) {
  Impl& f = *impl_;
  if (!isFinite(T_map_base.mean) || !T_map_base.cov.allFinite() ||
      T_map_base.cov.llt().info() != Eigen::Success) {
    ++f.core.dropped.not_finite;
    return f.tell(stamp, "pose", rejected("not finite"));
  }
  const auto step = f.core.advance(stamp);
  if (!step) return f.tell(stamp, "pose", rejected("stale"));
  f.take(step);
  if (!f.ready) {
    f.begin(T_map_base);
    UpdateReport report;
    report.reason = "initialised";
    return f.tell(stamp, "pose", report);
  }
  return f.tell(stamp, "pose", f.tracker.offer(PlanarModel::pose(f.tracker.state(), T_map_base)));
}

void PlanarFilter::reset(Timestamp stamp, const PoseWithCovariance& T_map_base) {
  Impl& f = *impl_;
  if (!f.core.reckoning.stale(stamp)) f.take(f.core.advance(stamp));
  f.begin(T_map_base);
}

bool PlanarFilter::ready() const { return impl_->ready; }

std::string PlanarFilter::waitingFor() const {
  if (impl_->ready) return {};
  if (!impl_->core.reckoning.started()) return "first wheel or IMU message";
  if (impl_->alignment.size() == 0) return "GNSS fix";
  return "heading: drive on with GNSS (" + std::to_string(impl_->alignment.size()) +
         " fixes over " + std::to_string(static_cast<int>(impl_->alignment.extent())) +
         " m so far)";
}

PoseWithCovariance PlanarFilter::pose() const { return impl_->tracker.pose(); }
Pose2 PlanarFilter::poseAt(Timestamp stamp) const {
  return carriedOn(impl_->core.reckoning, impl_->tracker.state(), stamp);
}
Timestamp PlanarFilter::time() const { return impl_->core.reckoning.time(); }
double PlanarFilter::yawRate() const { return impl_->odometry.yawRate(); }
double PlanarFilter::speed() const { return impl_->odometry.speed(); }
bool PlanarFilter::standstill() const { return impl_->odometry.standstill(); }
std::optional<PoseWithCovariance> PlanarFilter::initialAlignment() const {
  return impl_->initial_alignment;
}
std::pair<double, double> PlanarFilter::wheelScale() const {
  const Tracker& tracker = impl_->ready ? impl_->tracker : impl_->core.tracker;
  const Eigen::Vector2d m = tracker.marginal(kWheelScale);
  return {m[0], std::sqrt(m[1])};
}
const OdometryFilter& PlanarFilter::odometry() const { return impl_->odometry; }
const Dropped& PlanarFilter::dropped() const { return impl_->core.dropped; }

}  // namespace vestibule::ekf
