#include "vestibule/pipeline/time_ordered_queue.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace vestibule::pipeline {
namespace {

Measurement wheelsAt(std::int64_t ns) {
  WheelOdometry m;
  m.stamp = {ns};
  return m;
}
Measurement imuAt(std::int64_t ns) {
  Imu m;
  m.stamp = {ns};
  return m;
}

std::vector<std::int64_t> drain(TimeOrderedQueue& queue) {
  std::vector<std::int64_t> stamps;
  while (const auto m = queue.pop()) stamps.push_back(stampOf(*m).ns);
  return stamps;
}

TEST(TimeOrderedQueue, SortsWithinTheBoundAndHoldsBackWhatMayStillBeOvertaken) {
  TimeOrderedQueue queue(Duration(100));
  queue.push(imuAt(1050));
  queue.push(wheelsAt(1000));
  EXPECT_TRUE(drain(queue).empty());
  queue.push(imuAt(1120));
  EXPECT_EQ(drain(queue), (std::vector<std::int64_t>{1000}));
  queue.push(wheelsAt(1060));
  queue.finish();
  EXPECT_EQ(drain(queue), (std::vector<std::int64_t>{1050, 1060, 1120}));
}

TEST(TimeOrderedQueue, InertialDataComeFirstAtEqualStamps) {
  TimeOrderedQueue queue(Duration(10));
  queue.push(wheelsAt(5));
  queue.push(imuAt(5));
  queue.finish();
  EXPECT_TRUE(std::holds_alternative<Imu>(*queue.pop()));
  EXPECT_TRUE(std::holds_alternative<WheelOdometry>(*queue.pop()));
  EXPECT_FALSE(queue.pop());
}

TEST(TimeOrderedQueue, WhatComesTooLateIsStillHandedOver) {
  TimeOrderedQueue queue(Duration(10));
  queue.push(imuAt(100));
  queue.push(imuAt(200));
  EXPECT_EQ(drain(queue), (std::vector<std::int64_t>{100}));
  queue.push(wheelsAt(50));
  EXPECT_EQ(drain(queue), (std::vector<std::int64_t>{50}));
}

}  // namespace
}  // namespace vestibule::pipeline
