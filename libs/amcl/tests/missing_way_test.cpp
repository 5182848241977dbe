#include "../src/missing_way.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "../src/odometry_track.hpp"

namespace vestibule::amcl {
namespace {

struct Reading {
  double stamp_s = 0.0;
  double read_s = 0.0;  ///< when it was taken
};

/// A drive read out at 10 Hz, as `way` says how far the robot is at a time.
template <typename Way>
double largestError(const std::vector<Reading>& readings, bool borrowed, const Way& way) {
  OdometryTrack track;
  double largest_m = 0.0;
  Reading before;
  for (const Reading& now : readings) {
    WheelOdometry odometry;
    odometry.stamp = Timestamp{} + durationFromSeconds(now.stamp_s);
    odometry.dt_s = now.stamp_s - before.stamp_s;
    odometry.T_previous_now.x = way(now.read_s) - way(before.read_s);
    odometry.stamp_borrowed = borrowed;
    track.add(odometry);
    before = now;
    const double error_m = track.at(odometry.stamp).x - way(now.stamp_s);
    if (now.stamp_s > 1.0) largest_m = std::max(largest_m, std::abs(error_m));
  }
  return largest_m;
}

/// Every 20th reading was taken 0.3 s before its stamp, while the recorder stalled.
std::vector<Reading> stalling() {
  std::vector<Reading> readings;
  double t = 0.0;
  for (int i = 1; i <= 200; ++i) {
    const bool stalled = i % 20 == 0;
    t += stalled ? 0.4 : 0.1;
    readings.push_back({t, stalled ? t - 0.3 : t});
  }
  return readings;
}

double steady(double t_s) { return 1.1 * t_s; }

TEST(MissingWay, AReadingThatWasLateIsCarriedOn) {
  const double as_read_m = largestError(stalling(), false, steady);
  EXPECT_GT(as_read_m, 0.3);
  EXPECT_LT(largestError(stalling(), true, steady), 0.5 * as_read_m);
}

TEST(MissingWay, ARobotThatBrakesIsBelieved) {
  // GIVEN readings without delay, and a robot that stops within 0.3 s every other second
  std::vector<Reading> readings;
  for (int i = 1; i <= 200; ++i) readings.push_back({0.1 * i, 0.1 * i});
  const auto stops = [](double t_s) {
    constexpr double kSpeed = 0.8;
    constexpr double kBraking_s = 0.3;
    const double phase = std::fmod(t_s, 2.0);
    const double before = std::floor(t_s / 2.0) * kSpeed * (1.0 + 0.5 * kBraking_s);
    if (phase < 1.0) return before + kSpeed * phase;
    const double braking = std::min(phase - 1.0, kBraking_s);
    return before + kSpeed * (1.0 + braking - 0.5 * braking * braking / kBraking_s);
  };
  // THEN it is never thought to have gone on for more than a few centimetres
  EXPECT_LT(largestError(readings, true, stops), 0.06);
}

TEST(MissingWay, LeapsOfTheOdometryMoveNothing) {
  // GIVEN odometry that stands still for a second while the robot drives, and then has it all
  MissingWay missing;
  for (int i = 0; i < 10; ++i) missing.take(0.16, 0.21);
  for (int i = 0; i < 5; ++i) missing.take(0.0, 0.21);
  missing.take(0.9, 0.21);
  // THEN it is not taken for a speed of 4 m/s
  EXPECT_NEAR(missing.mean_m(), 0.0, 0.02);
  for (int i = 0; i < 10; ++i) {
    missing.take(0.16, 0.21);
    EXPECT_LT(std::abs(missing.mean_m()), 0.06);
  }
}

TEST(MissingWay, GapsAndBurstsOfStampsSayNothing) {
  MissingWay missing;
  for (int i = 0; i < 10; ++i) missing.take(0.1, 0.1);
  missing.take(0.03, 0.0003);
  EXPECT_EQ(missing.mean_m(), 0.0);
  EXPECT_EQ(missing.var_m2(), 0.0);
  for (int i = 0; i < 10; ++i) missing.take(0.1, 0.1);
  missing.take(2.0, 3.0);
  EXPECT_EQ(missing.mean_m(), 0.0);
}

}  // namespace
}  // namespace vestibule::amcl
