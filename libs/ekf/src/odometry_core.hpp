#pragma once

#include <optional>

#include "dead_reckoning.hpp"
#include "tracker.hpp"
#include "vestibule/ekf/filter.hpp"

namespace vestibule::ekf {

/// What an odometry filter is made of; hands its steps on, for the map filter to take the same.
class OdometryFilter::Core {
 public:
  explicit Core(const FilterParams& params);

  /// Empty when the message was dropped.
  std::optional<Motion> process(const WheelOdometry& wheels);
  std::optional<Motion> process(const Imu& imu);
  /// Takes the step to the stamp of some other measurement.
  std::optional<Motion> advance(Timestamp stamp);
  /// \pre advanced to the heading's stamp
  void update(const Heading& heading) { (void)tracker.offerHeading(heading); }
  /// Rate over `interval_s` measured while standing, if this message was such.
  [[nodiscard]] std::optional<double> zeroRateInterval() const { return zero_rate_interval_s_; }

  FilterParams params;
  DeadReckoning reckoning;
  Tracker tracker;
  Dropped dropped;

 private:
  std::optional<Timestamp> last_imu_;
  std::optional<double> zero_rate_interval_s_;
};

/// The pose carried on to `stamp` with held speed and rate.
[[nodiscard]] Pose2 carriedOn(const DeadReckoning& reckoning, const State& state, Timestamp stamp);

}  // namespace vestibule::ekf
