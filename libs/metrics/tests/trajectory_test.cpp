#include "vestibule/metrics/trajectory.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule::metrics {
namespace {

using std::chrono::milliseconds;

Timestamp at(double seconds) { return timestampFromSeconds(seconds); }

/// A circle of radius 5 m, one pose per 0.1 s, 0.1 rad per pose.
Trajectory circle(int n) {
  Trajectory trajectory;
  for (int i = 0; i < n; ++i) {
    const double a = 0.1 * i;
    trajectory.push_back(
        {at(0.1 * i), Pose2(5 * std::cos(a), 5 * std::sin(a), wrapToPi(a + 1.57))});
  }
  return trajectory;
}

TEST(Associate, TakesTheNearestWithinTheLimit) {
  const Trajectory reference = circle(10);
  Trajectory estimate{
      {at(0.104), Pose2(1, 0, 0)}, {at(0.45), Pose2(2, 0, 0)}, {at(0.893), Pose2(3, 0, 0)}};
  const auto matches = associate(estimate, reference);
  ASSERT_EQ(matches.size(), 2u);
  EXPECT_EQ(matches[0].reference, reference[1].pose);
  EXPECT_EQ(matches[1].reference, reference[9].pose);
  EXPECT_EQ(matches[1].estimate.x, 3.0);
}

TEST(Associate, KeepsFileOrderWhereStampsRepeatAndRunBackwards) {
  Trajectory reference{
      {at(1.0), Pose2(0, 0, 0)},
      {at(2.0), Pose2(1, 0, 0)},
      {at(1.0), Pose2(2, 0, 0)},
      {at(2.0), Pose2(3, 0, 0)}};
  const auto matches = associate(reference, reference, {Matching::kNearest, Duration(0)});
  ASSERT_EQ(matches.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(matches[i].reference.x, static_cast<double>(i));
}

TEST(Associate, InterpolatesAlongTheArc) {
  const Trajectory reference = circle(20);
  const auto matches = associate(
      {{at(0.75), Pose2()}, {at(5.0), Pose2()}},
      reference,
      {Matching::kInterpolated, milliseconds(60)});
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_NEAR(std::hypot(matches[0].reference.x, matches[0].reference.y), 5.0, 1e-5);
  EXPECT_NEAR(std::atan2(matches[0].reference.y, matches[0].reference.x), 0.75, 1e-5);
}

TEST(AbsoluteErrors, ShowAnOffsetAndAlignmentRemovesIt) {
  const Trajectory reference = circle(50);
  const Pose2 T_reference_estimate(3.0, -4.0, 2.5);
  Trajectory estimate = reference;
  for (auto& p : estimate) p.pose = compose(inverse(T_reference_estimate), p.pose);
  const auto matches = associate(estimate, reference);
  const PoseErrors raw = absoluteErrors(matches, Alignment::kNone);
  EXPECT_NEAR(raw.yaw_rad.mean, 2.5, 1e-9);
  EXPECT_GT(raw.translation_m.rmse, 4.0);
  const PoseErrors aligned = absoluteErrors(matches, Alignment::kSe2);
  EXPECT_LT(aligned.translation_m.max, 1e-9);
  EXPECT_LT(aligned.yaw_rad.max, 1e-9);
  EXPECT_NEAR(aligned.T_reference_estimate.x, 3.0, 1e-9);
  EXPECT_NEAR(aligned.T_reference_estimate.phi, 2.5, 1e-9);
}

TEST(RelativeErrors, SeeAWrongScaleButNoOffset) {
  const Trajectory reference = circle(200);
  Trajectory estimate = reference;
  for (auto& p : estimate)
    p.pose = compose(Pose2(10, 20, 1), Pose2(1.1 * p.pose.x, 1.1 * p.pose.y, p.pose.phi));
  const auto matches = associate(estimate, reference);
  const PoseErrors errors = relativeErrorsOverDistance(matches, 2.0);
  // 2 m on the 5 m circle are at least five poses; the chord between them grows by a tenth.
  EXPECT_NEAR(errors.translation_m.mean, 0.1 * 2 * 5 * std::sin(0.25), 1e-6);
  EXPECT_LT(errors.yaw_rad.max, 1e-9);
  const PoseErrors over_time = relativeErrorsOverTime(matches, milliseconds(500));
  EXPECT_EQ(over_time.translation_m.count, 195u);
  EXPECT_NEAR(over_time.translation_m.mean, 0.1 * 2 * 5 * std::sin(0.25), 1e-6);
}

}  // namespace
}  // namespace vestibule::metrics
