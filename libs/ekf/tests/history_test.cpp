// Late, reordered and repeated measurements.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <variant>
#include <vector>

#include "vestibule/core/random.hpp"
#include "vestibule/ekf/filter.hpp"

namespace vestibule::ekf {
namespace {

using std::chrono::milliseconds;
using Message = std::variant<Imu, Heading, WheelOdometry, MapFix>;

/// A drive in a slow curve with everything aboard: gyro 50 Hz, wheels 20 Hz, heading 10 Hz, GNSS
/// 5 Hz.
std::vector<Message> drive(std::uint64_t seed, double seconds) {
  RandomStream random(seed, "history");
  std::vector<Message> messages;
  for (int i = 1; i <= static_cast<int>(seconds * 100); ++i) {
    const Timestamp now = Timestamp{0} + milliseconds(10) * i;
    const double t = 0.01 * i;
    const double yaw = 0.1 * t;
    if (i % 2 == 0) {
      Imu imu;
      imu.stamp = now;
      imu.omega_radps = {random.normal(0, 0.01), random.normal(0, 0.01), random.normal(0.1, 0.01)};
      imu.accel_mps2 = {random.normal(0, 0.1), random.normal(0, 0.1), random.normal(9.81, 0.1)};
      messages.emplace_back(imu);
    }
    if (i % 5 == 0) {
      messages.emplace_back(WheelOdometry{
          now, 0.05, Pose2(random.normal(0.05, 0.001), 0, random.normal(0.005, 0.001))});
    }
    if (i % 10 == 0) {
      messages.emplace_back(Heading{now, yaw + random.normal(0, 0.05), 0.05, Tilt{0.01, 0.02}});
    }
    if (i % 20 == 0) {
      MapFix fix;
      fix.stamp = now;
      fix.p_map_antenna = {10 * std::sin(yaw) + random.normal(), 10 - 10 * std::cos(yaw), 0.0};
      fix.type = GnssFixType::kDifferential;
      messages.emplace_back(fix);
    }
  }
  return messages;
}

void feed(MapFilter& filter, const Message& message) {
  std::visit([&filter](const auto& m) { (void)filter.process(m); }, message);
}

/// Every bit of what the filter believes.
std::string fingerprint(const MapFilter& filter) {
  std::string bytes;
  const auto add = [&bytes](const void* data, std::size_t size) {
    bytes.append(static_cast<const char*>(data), size);
  };
  const auto addState = [&add](const State& x) {
    add(x.p.data(), sizeof(double) * 3);
    add(x.v.data(), sizeof(double) * 3);
    add(x.q.coeffs().data(), sizeof(double) * 4);
    add(x.gyro_bias.data(), sizeof(double) * 3);
    add(x.accel_bias.data(), sizeof(double) * 3);
    const double rest[] = {
        x.wheel_scale, x.wheel_skew, x.track, x.icr_x, x.heading_offset, x.disturbance};
    add(rest, sizeof(rest));
    add(x.gnss_bias.data(), sizeof(double) * 3);
  };
  addState(filter.odometryState());
  if (filter.ready()) {
    addState(filter.state());
    add(filter.covariance().data(), sizeof(double) * kStateSize * kStateSize);
  }
  return bytes;
}

class AnyOrder : public testing::TestWithParam<bool> {
 protected:
  AnyOrder() {
    params.plane = GetParam();
    params.heading.offset_sigma_rad = 0.1;
  }
  FilterParams params;
  SensorRig rig;
};

TEST_P(AnyOrder, OfArrivalWithinTheWindowEndsInTheSameBits) {
  const std::vector<Message> messages = drive(1, 30.0);
  MapFilter in_order(params, rig);
  for (const Message& m : messages) feed(in_order, m);
  ASSERT_TRUE(in_order.ready()) << in_order.waitingFor();
  const std::string expected = fingerprint(in_order);
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    RandomStream random(seed, "shuffle");
    // Each message is up to 1.5 s late, and one in ten comes twice.
    std::vector<std::pair<double, Message>> arrivals;
    for (const Message& m : messages) {
      const double stamp_s = std::visit([](const auto& x) { return toSeconds(x.stamp); }, m);
      arrivals.emplace_back(stamp_s + random.uniform(0.0, 1.5), m);
      if (random.bernoulli(0.1)) arrivals.emplace_back(stamp_s + random.uniform(0.0, 1.5), m);
    }
    std::stable_sort(arrivals.begin(), arrivals.end(), [](const auto& a, const auto& b) {
      return a.first < b.first;
    });
    MapFilter filter(params, rig);
    Timestamp before = filter.time();
    for (const auto& [arrival, m] : arrivals) {
      feed(filter, m);
      ASSERT_GE(filter.time().ns, before.ns) << "output stamps must not go back";
      before = filter.time();
    }
    EXPECT_EQ(filter.dropped().count("stale"), 0U);
    EXPECT_GT(filter.dropped().at("duplicate"), 100U);
    EXPECT_GT(filter.replays(), 100U);
    ASSERT_EQ(fingerprint(filter), expected) << "shuffle " << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(
    PlaneAndSpace, AnyOrder, testing::Values(true, false), [](const auto& each) {
      return each.param ? "plane" : "space";
    });

TEST(History, RefusesWhatIsOlderThanTheWindowAndSaysSo) {
  FilterParams params;
  params.history_s = 0.5;
  MapFilter filter(params, SensorRig());
  for (const Message& m : drive(2, 20.0)) feed(filter, m);
  const std::string before = fingerprint(filter);
  const UpdateReport report =
      filter.process(WheelOdometry{filter.time() - milliseconds(900), 0.05, Pose2(1, 0, 0)});
  EXPECT_EQ(report.reason, "stale");
  EXPECT_EQ(report.decision, Decision::kRejected);
  EXPECT_EQ(filter.dropped().at("stale"), 1U);
  EXPECT_EQ(fingerprint(filter), before);
}

TEST(History, ALateFixIsReportedAsUsedWhereItBelongs) {
  MapFilter filter{FilterParams(), SensorRig()};
  std::vector<Message> messages = drive(3, 40.0);
  const auto last_fix = std::find_if(messages.rbegin(), messages.rend(), [](const Message& m) {
    return std::holds_alternative<MapFix>(m);
  });
  const MapFix fix = std::get<MapFix>(*last_fix);
  messages.erase(std::next(last_fix).base());
  // 0.4 s more of driving before the fix arrives.
  for (const Message& m : messages) feed(filter, m);
  for (int i = 1; i <= 40; ++i) {
    Imu imu;
    imu.stamp = fix.stamp + milliseconds(10) * i;
    imu.accel_mps2.z() = 9.81;
    (void)filter.process(imu);
  }
  const UpdateReport report = filter.process(fix);
  EXPECT_EQ(report.decision, Decision::kAccepted) << report.reason << " " << report.nis;
  EXPECT_GT(report.dof, 0);
}

}  // namespace
}  // namespace vestibule::ekf
