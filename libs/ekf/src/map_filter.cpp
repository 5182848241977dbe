#include <variant>

#include "history.hpp"
#include "vestibule/ekf/filter.hpp"

namespace vestibule::ekf {
namespace {

const char* sensorOf(const Input& input) {
  switch (input.index()) {
    case 0:
      return "imu";
    case 1:
      return "heading";
    case 2:
      return "wheels";
    case 3:
      return "gnss";
    case 4:
      return "gnss_velocity";
    default:
      return "pose";
  }
}

/// The covariance without what rounding makes of its two halves.
PoseWithCovariance symmetric(const PoseWithCovariance& T) {
  return {T.mean, 0.5 * (T.cov + T.cov.transpose())};
}

}  // namespace

struct MapFilter::Impl {
  Impl(const FilterParams& params, const SensorRig& r, const Observers* o)
      : shared(params),
        rig(r),
        observers(o),
        history(Core(shared, rig), durationFromSeconds(params.history_s)) {}

  UpdateReport process(const Input& input) {
    UpdateReport report;
    const char* fault = unusable(input);
    const bool unused = *fault != '\0';
    if (unused) {
      report.decision = Decision::kRejected;
      report.reason = fault;
    } else {
      report = history.insert(input);
    }
    if (report.decision == Decision::kRejected) {
      // Headings that are left out because there are so many are no news.
      if (report.reason == kTooSoon) return report;
      if (unused || report.reason == "stale" || report.reason == "duplicate" ||
          report.reason == "not finite") {
        ++dropped[report.reason];
      }
    }
    // Wheels and IMU have nothing to be tested against: only what is lost of them is news.
    if (observers == nullptr) return report;
    const bool quiet = std::holds_alternative<Imu>(input) ||
                       std::holds_alternative<WheelOdometry>(input) ||
                       std::holds_alternative<ResetInput>(input);
    if (!quiet) {
      observers->emit(UpdateEvent{
          stampOf(input),
          sensorOf(input),
          report.decision,
          report.reason,
          report.nis,
          report.gate,
          report.dof});
    }
    return report;
  }
  [[nodiscard]] const Core& core() const { return history.core(); }

  Shared shared;
  SensorRig rig;
  const Observers* observers;
  History history;
  Dropped dropped;
};

MapFilter::MapFilter(const FilterParams& params, const SensorRig& rig, const Observers* observers)
    : impl_(std::make_unique<Impl>(params, rig, observers)) {}
MapFilter::~MapFilter() = default;

UpdateReport MapFilter::process(const WheelOdometry& wheels) { return impl_->process(wheels); }
UpdateReport MapFilter::process(const Imu& imu) { return impl_->process(imu); }
UpdateReport MapFilter::process(const Heading& heading) { return impl_->process(heading); }
UpdateReport MapFilter::process(const MapFix& fix) {
  const UpdateReport report = impl_->process(fix);
  if (fix.velocity && fix.type != GnssFixType::kNone) {
    (void)impl_->process(VelocityInput{fix.stamp, *fix.velocity});
  }
  return report;
}
UpdateReport MapFilter::processExternalPose(Timestamp stamp, const PoseWithCovariance& T_map_base) {
  return impl_->process(PoseInput{stamp, symmetric(T_map_base)});
}
UpdateReport MapFilter::reset(Timestamp stamp, const PoseWithCovariance& T_map_base) {
  return impl_->process(ResetInput{stamp, symmetric(T_map_base)});
}

Timestamp MapFilter::time() const { return impl_->core().time(); }
bool MapFilter::started() const { return impl_->core().started(); }
PoseWithCovariance MapFilter::odometry() const { return impl_->core().odometry().pose(); }
const State& MapFilter::odometryState() const { return impl_->core().odometry().state(); }
double MapFilter::yawRate() const {
  if (standstill()) return 0.0;
  const DeadReckoning& reckoning = impl_->core().reckoning();
  return reckoning.rate().z() - (reckoning.rateIsGyro() ? odometryState().gyro_bias.z() : 0.0);
}
double MapFilter::speed() const { return impl_->core().reckoning().speed(); }
bool MapFilter::standstill() const { return impl_->core().reckoning().standstill(); }
bool MapFilter::ready() const { return impl_->core().ready(); }
std::string MapFilter::waitingFor() const { return impl_->core().waitingFor(); }
PoseWithCovariance MapFilter::pose() const { return impl_->core().map().pose(); }
const State& MapFilter::state() const { return impl_->core().map().state(); }
const StateMatrix& MapFilter::covariance() const { return impl_->core().map().covariance(); }
Pose2 MapFilter::poseAt(Timestamp stamp) const {
  return carriedOn(impl_->shared.model, impl_->core(), impl_->core().map().state(), stamp);
}
Pose2 MapFilter::odometryAt(Timestamp stamp) const {
  return carriedOn(impl_->shared.model, impl_->core(), impl_->core().odometry().state(), stamp);
}
MapFilter::Expected MapFilter::expected(const MapFix& fix) const {
  Core core = impl_->core();
  core.record(nullptr);
  return core.expected(fix);
}
std::optional<PoseWithCovariance> MapFilter::initialAlignment() const {
  return impl_->core().initialAlignment();
}
const Dropped& MapFilter::dropped() const { return impl_->dropped; }
std::size_t MapFilter::replays() const { return impl_->history.replays(); }
void MapFilter::expectOrder() { impl_->history.keepOrder(true); }
void MapFilter::record(Tape* tape) {
  if (tape != nullptr) expectOrder();
  impl_->history.core().record(tape);
}

}  // namespace vestibule::ekf
