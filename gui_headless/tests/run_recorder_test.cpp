#include "vestibule/gui_headless/run_recorder.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "synthetic_run.hpp"

namespace vestibule::gui_headless {
namespace {

PoseEvent poseAt(int i, PoseSource source = PoseSource::kPublished) {
  PoseEvent event{timestampFromSeconds(0.01 * i), source, Mode::kOutdoor, {}};
  event.T.mean = Pose2(0.5 * i, 0.0, 0.0);
  return event;
}

TEST(RunRecorder, KeepsFirstAndLastPoseWithinTheLimit) {
  RecorderLimits limits;
  limits.max_poses = 100;
  RunRecorder run(limits);
  for (int i = 0; i < 12346; ++i) run.onPose(poseAt(i));
  const auto poses = run.poses(PoseSource::kPublished);
  EXPECT_LE(poses.size(), 101u);  // and the last one
  EXPECT_GE(poses.size(), 50u);
  EXPECT_DOUBLE_EQ(poses.front().T.mean.x, 0.0);
  EXPECT_DOUBLE_EQ(poses.back().T.mean.x, 0.5 * 12345);
  EXPECT_EQ(run.posesSeen(PoseSource::kPublished), 12346u);
  EXPECT_NEAR(run.distanceTravelled(), 0.5 * 12345, 1e-6);
  // Evenly: no gap but the last is longer than the first one.
  const double first_gap = poses[1].T.mean.x - poses[0].T.mean.x;
  for (std::size_t i = 2; i + 1 < poses.size(); ++i) {
    ASSERT_NEAR(poses[i].T.mean.x - poses[i - 1].T.mean.x, first_gap, 1e-9) << "at " << i;
  }
}

TEST(RunRecorder, ShowsTheMostAuthoritativeEstimate) {
  RunRecorder run;
  EXPECT_FALSE(run.primarySource());
  run.onPose(poseAt(0, PoseSource::kOdometry));
  EXPECT_FALSE(run.primarySource());
  run.onPose(poseAt(0, PoseSource::kGnssFilter));
  EXPECT_EQ(run.primarySource(), PoseSource::kGnssFilter);
  run.onPose(poseAt(0, PoseSource::kParticles));
  EXPECT_EQ(run.primarySource(), PoseSource::kParticles);
  run.onPose(poseAt(0, PoseSource::kPublished));
  EXPECT_EQ(run.primarySource(), PoseSource::kPublished);
}

TEST(RunRecorder, DropsPosesThatAreNotNumbers) {
  RunRecorder run;
  PoseEvent event = poseAt(3);
  event.T.mean.x = std::numeric_limits<double>::quiet_NaN();
  run.onPose(event);
  EXPECT_TRUE(run.primaryPoses().empty());
  EXPECT_FALSE(run.span());
}

TEST(RunRecorder, KeepsFewSnapshotsOfTheParticlesInProportionToTheirWeights) {
  RecorderLimits limits;
  limits.max_snapshots = 12;
  limits.max_particles = 400;
  RunRecorder run(limits);
  // GIVEN 2000 particles, the first quarter of which carries nine tenths of the weight
  std::vector<Pose2> set(2000);
  std::vector<double> weights(2000, 0.1 / 1500.0);
  for (std::size_t i = 0; i < 500; ++i) {
    set[i].x = 1.0;
    weights[i] = 0.9 / 500.0;
  }
  for (int i = 0; i < 333; ++i) {
    run.onParticles({timestampFromSeconds(i), set, weights, 100.0, 1.0});
  }
  // THEN few snapshots remain, among them the first and the last, with the same share
  const auto snapshots = run.snapshots();
  EXPECT_LE(snapshots.size(), 13u);
  EXPECT_GE(snapshots.size(), 6u);
  EXPECT_EQ(snapshots.front().stamp, timestampFromSeconds(0));
  EXPECT_EQ(snapshots.back().stamp, timestampFromSeconds(332));
  ASSERT_EQ(snapshots.back().T_map_particles.size(), 400u);
  int heavy = 0;
  for (const Pose2& T : snapshots.back().T_map_particles) heavy += T.x > 0.5 ? 1 : 0;
  EXPECT_NEAR(heavy, 360, 1);
}

TEST(RunRecorder, CountsEveryUpdateAndKeepsABoundedSeries) {
  RecorderLimits limits;
  limits.max_updates = 64;
  RunRecorder run(limits);
  for (int i = 0; i < 1000; ++i) {
    const bool bad = i % 10 == 0;
    run.onUpdate(
        {timestampFromSeconds(i),
         "gnss",
         bad ? Decision::kGated : Decision::kAccepted,
         bad ? "chi2" : "",
         bad ? 40.0 : 1.0,
         9.2,
         2});
  }
  const SensorUpdates& gnss = run.updates().at("gnss");
  EXPECT_EQ(gnss.count(Decision::kAccepted), 900u);
  EXPECT_EQ(gnss.count(Decision::kGated), 100u);
  EXPECT_EQ(gnss.total(), 1000u);
  EXPECT_EQ(gnss.refusals.at("chi2"), 100u);
  EXPECT_LE(gnss.samples.kept.size(), 64u);
  EXPECT_GE(gnss.samples.kept.size(), 32u);
}

TEST(RunRecorder, BoundsEventsAndFoldsRepeatedWarnings) {
  RecorderLimits limits;
  limits.max_events = 10;
  limits.max_warnings = 3;
  RunRecorder run(limits);
  for (int i = 0; i < 25; ++i) {
    run.onMode({timestampFromSeconds(i), Mode::kOutdoor, Mode::kIndoor, "test", {}});
    run.onWarning({timestampFromSeconds(i), "gnss", "gap", 1.0 + i, 0.5});
  }
  for (int i = 0; i < 5; ++i) {
    run.onWarning({timestampFromSeconds(30), "scan", "kind " + std::to_string(i), 0.0, 0.0});
  }
  EXPECT_EQ(run.modeEvents().size(), 10u);
  ASSERT_EQ(run.warnings().size(), 3u);
  EXPECT_EQ(run.warnings()[0].count, 25u);
  EXPECT_DOUBLE_EQ(run.warnings()[0].value, 1.0);
  EXPECT_EQ(run.warnings()[0].last, timestampFromSeconds(24));
  EXPECT_EQ(run.eventsNotKept(), 15u + 3u);
}

TEST(ModeSpans, FollowTheModeEventsAndCoverTheRun) {
  SyntheticRun drive;
  RunRecorder run;
  drive.drive(run);
  const auto spans = modeSpans(run);
  ASSERT_GE(spans.size(), 5u);
  EXPECT_EQ(spans.front().from, run.span()->first);
  EXPECT_EQ(spans.back().to, run.span()->second);
  EXPECT_EQ(spans[0].mode, Mode::kOutdoor);
  EXPECT_EQ(spans[1].mode, Mode::kDeadReckoning);
  EXPECT_EQ(spans[1].reason, "GNSS fades at the door");
  EXPECT_EQ(spans[2].mode, Mode::kIndoor);
  for (std::size_t i = 1; i < spans.size(); ++i) EXPECT_EQ(spans[i].from, spans[i - 1].to);
}

TEST(ModeSpans, ComeFromThePosesWithoutModeEvents) {
  RunRecorder run;
  for (int i = 0; i < 30; ++i) {
    PoseEvent event = poseAt(i);
    event.mode = i < 10 ? Mode::kIndoor : Mode::kLost;
    run.onPose(event);
  }
  const auto spans = modeSpans(run);
  ASSERT_EQ(spans.size(), 2u);
  EXPECT_EQ(spans[0].mode, Mode::kIndoor);
  EXPECT_EQ(spans[1].mode, Mode::kLost);
  EXPECT_EQ(spans[1].from, timestampFromSeconds(0.1));
}

}  // namespace
}  // namespace vestibule::gui_headless
