#include "vestibule/sim/transport.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "moments.hpp"

namespace vestibule::sim {
namespace {

constexpr Timestamp kStart{1'000'000'000'000};
Timestamp at(double seconds) { return kStart + durationFromSeconds(seconds); }

Imu imu(double seconds) {
  Imu m;
  m.stamp = at(seconds);
  return m;
}

std::vector<Delivered> carry(const TransportParams& params, int count, double step_s) {
  Transport transport(params, kStart, 7);
  for (int i = 0; i < count; ++i) transport.send(imu(step_s * i));
  return transport.receive(at(step_s * count + 1000.0));
}

double delayOf(const Delivered& d) { return toSeconds(d.arrival - stampOf(d.measurement)); }

TEST(Transport, WithoutFaultsIsTheIdentity) {
  const auto all = carry({}, 100, 0.01);
  ASSERT_EQ(all.size(), 100U);
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(all[i].arrival, at(0.01 * static_cast<double>(i)));
    EXPECT_EQ(stampOf(all[i].measurement), all[i].arrival);
  }
}

TEST(Transport, DelaysAreLognormal) {
  TransportParams params;
  params.imu.delay_s = 0.1;
  params.imu.delay_jitter = 0.5;
  params.imu.in_order = false;
  Moments log_delay;
  bool reordered = false;
  Timestamp last{};
  for (const Delivered& d : carry(params, 4000, 0.01)) {
    log_delay.add(std::log(delayOf(d)));
    reordered = reordered || stampOf(d.measurement) < last;
    last = stampOf(d.measurement);
  }
  // 4000 samples: 5 sigma of the mean = 0.04, of sigma = 5.6 %.
  EXPECT_NEAR(log_delay.mean(), std::log(0.1), 0.04);
  EXPECT_NEAR(log_delay.sigma(), 0.5, 0.028);
  EXPECT_TRUE(reordered);

  params.imu.in_order = true;
  last = {};
  for (const Delivered& d : carry(params, 1000, 0.01)) {
    EXPECT_GT(stampOf(d.measurement), last);
    last = stampOf(d.measurement);
  }
}

TEST(Transport, LosesAndDoubles) {
  TransportParams params;
  params.imu.loss = 0.1;
  EXPECT_NEAR(static_cast<double>(carry(params, 10000, 0.01).size()), 9000.0, 150.0);
  params.imu.loss = 0.0;
  params.imu.duplicate = 0.1;
  EXPECT_NEAR(static_cast<double>(carry(params, 10000, 0.01).size()), 11000.0, 150.0);
}

TEST(Transport, BadTimesComeAndGo) {
  TransportParams params;
  params.imu.burst_rate_hz = 0.05;
  params.imu.burst_s = 2.0;
  params.imu.burst_loss = 1.0;
  const auto all = carry(params, 400000, 0.01);
  // A good time of 20 s and a bad one of 2 s: one message in eleven is lost. About 180 cycles:
  // 5 sigma of the share = 0.045.
  EXPECT_NEAR(1.0 - static_cast<double>(all.size()) / 400000.0, 2.0 / 22.0, 0.045);
  int gaps = 0;
  for (std::size_t i = 1; i < all.size(); ++i) {
    gaps += stampOf(all[i].measurement) - stampOf(all[i - 1].measurement) >
                    std::chrono::milliseconds(15)
                ? 1
                : 0;
  }
  EXPECT_NEAR(gaps, 4000.0 / 22.0, 70.0);
}

TEST(Transport, ClocksDriftAndStampsJump) {
  TransportParams params;
  params.imu.clock_offset_s = 0.5;
  params.imu.clock_drift_ppm = 40.0;
  params.imu.stamp_jumps = {{60.0, 1.0}};
  for (const Delivered& d : carry(params, 1000, 0.1)) {
    const double time_s = toSeconds(d.arrival - kStart);
    EXPECT_NEAR(-delayOf(d), 0.5 + 40e-6 * time_s + (time_s >= 60.0 - 1e-9 ? 1.0 : 0.0), 1e-6);
  }
}

TEST(Transport, ASensorDiesAndComesBack) {
  TransportParams params;
  params.imu.outages = {{2.0, 5.0}};
  const auto all = carry(params, 1000, 0.01);
  EXPECT_EQ(all.size(), 700U);
  for (const Delivered& d : all) {
    const double time_s = toSeconds(d.arrival - kStart);
    EXPECT_TRUE(time_s < 2.0 || time_s > 4.999) << time_s;
  }
}

TEST(Transport, LinksDoNotDisturbEachOther) {
  TransportParams params;
  params.imu.delay_s = 0.01;
  params.imu.delay_jitter = 1.0;
  params.imu.loss = 0.2;
  params.wheels = params.imu;
  Transport alone(params, kStart, 3);
  Transport both(params, kStart, 3);
  for (int i = 0; i < 500; ++i) {
    alone.send(imu(0.01 * i));
    WheelOdometry wheels;
    wheels.stamp = at(0.01 * i);
    both.send(wheels);
    both.send(imu(0.01 * i));
  }
  std::vector<std::int64_t> a;
  std::vector<std::int64_t> b;
  for (const Delivered& d : alone.receive(at(100))) a.push_back(d.arrival.ns);
  for (const Delivered& d : both.receive(at(100))) {
    if (std::holds_alternative<Imu>(d.measurement)) b.push_back(d.arrival.ns);
  }
  EXPECT_EQ(a, b);
}

}  // namespace
}  // namespace vestibule::sim
