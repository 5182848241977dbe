#include "vestibule/mode_manager/mode_manager.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "matchers.hpp"

namespace vestibule::mode_manager {
namespace {

using ::testing::HasSubstr;

geo::Site farm() {
  geo::Site site;
  site.name = "farm";
  site.buildings = {{"stable", {{50, -10}, {80, -10}, {80, 10}, {50, 10}}}};
  site.indoor_maps = {{"stable", "stable.yaml", {}, 0.05, 0.002}};
  return site;
}

class ModeLog : public Observer {
 public:
  void onMode(const ModeEvent& event) override { events.push_back(event); }
  std::vector<ModeEvent> events;
};

/// Drives east along y = 0 with perfect odometry; the test says what the estimators report.
class Crossing : public ::testing::Test {
 protected:
  Crossing() : manager({}, farm(), &observers) { observers.attach(log); }

  struct Inputs {
    bool fixes = true;
    double gnss_offset_m = 0.0;
    double gnss_sigma_m = 0.1;
    double trust = -1.0;  // negative: no particles
    double particles_offset_m = 0.0;
  };

  void drive(double seconds, const Inputs& in, double speed_mps = 1.0) {
    const Eigen::Matrix3d gnss_cov =
        Eigen::Vector3d(in.gnss_sigma_m * in.gnss_sigma_m, in.gnss_sigma_m * in.gnss_sigma_m, 1e-4)
            .asDiagonal();
    const Eigen::Matrix3d map_cov = Eigen::Vector3d(0.0025, 0.0025, 1e-4).asDiagonal();
    for (int i = 0; i < static_cast<int>(seconds * 50.0); ++i) {
      now = now + std::chrono::milliseconds(20);
      T_odom_base.x += speed_mps * 0.02;
      const Pose2 truth = T_odom_base;  // map = odom here
      if (in.fixes) last_fix = now;
      manager.offerGnss(
          {now, {{truth.x, truth.y + in.gnss_offset_m, 0.0}, gnss_cov}, T_odom_base}, last_fix);
      if (in.trust >= 0.0) {
        manager.offerParticles(
            {now, {{truth.x, truth.y + in.particles_offset_m, 0.0}, map_cov}, T_odom_base},
            in.trust);
      }
      manager.step(now, T_odom_base);
    }
  }

  Observers observers;
  ModeLog log;
  ModeManager manager;
  Timestamp now;
  Pose2 T_odom_base;
  std::optional<Timestamp> last_fix;
};

TEST_F(Crossing, InAndOutSwitchesOnceEachAndSaysWhy) {
  drive(20.0, {});  // at x = 20, 30 m from the stable
  EXPECT_EQ(manager.mode(), Mode::kOutdoor);
  drive(15.0, {true, 0.3, 0.1, 0.9, 0.0});
  EXPECT_EQ(manager.mode(), Mode::kIndoor);
  drive(45.0, {false, 5.0, 3.0, 0.8, 0.0});  // through the stable without GNSS
  drive(10.0, {true, 0.0, 0.1, 0.8, 0.0});   // out on the other side, the map still fits
  EXPECT_EQ(manager.mode(), Mode::kIndoor);
  drive(20.0, {true, 0.0, 0.1, 0.2, 0.0});  // beyond the map
  EXPECT_EQ(manager.mode(), Mode::kOutdoor);
  ASSERT_EQ(log.events.size(), 3U);  // first position, in, out
  EXPECT_THAT(log.events[1].reason, HasSubstr("scan fits the map"));
  EXPECT_EQ(log.events[1].to, Mode::kIndoor);
  EXPECT_EQ(log.events[2].to, Mode::kOutdoor);
  EXPECT_THAT(manager.published().mean, poseNear(T_odom_base, 0.02, 1e-3));
}

TEST_F(Crossing, AMapMatchThatContradictsHealthyGnssGetsNoAuthority) {
  drive(20.0, {});
  drive(20.0, {true, 0.0, 0.1, 0.95, 12.0});
  EXPECT_EQ(manager.mode(), Mode::kOutdoor);
  EXPECT_NEAR(manager.published().mean.y, 0.0, 0.01);
}

TEST_F(Crossing, ABriefGoodScanIsNotEnough) {
  drive(32.0, {});
  drive(0.8, {true, 0.0, 0.1, 0.9, 0.0});
  drive(1.0, {true, 0.0, 0.1, 0.1, 0.0});
  EXPECT_EQ(manager.mode(), Mode::kOutdoor);
}

TEST_F(Crossing, WithoutAnySourceItDeadReckonsThenSaysThatItIsLost) {
  drive(5.0, {});
  drive(10.0, {false});
  EXPECT_EQ(manager.mode(), Mode::kDeadReckoning);
  const double sigma = manager.published().cov(0, 0);
  drive(40.0, {false});
  EXPECT_GT(manager.published().cov(0, 0), sigma);
  drive(45.0, {false});
  EXPECT_EQ(manager.mode(), Mode::kLost);
  EXPECT_THAT(log.events.back().reason, HasSubstr("without any position"));
  // Odometry still carries the pose.
  EXPECT_THAT(manager.published().mean, poseNear(T_odom_base, 1e-6, 1e-6));
}

TEST_F(Crossing, SeedsAreAskedForNearABuildingOnly) {
  drive(15.0, {});
  EXPECT_FALSE(manager.particlesWanted());
  EXPECT_FALSE(manager.takeSeedRequest());
  drive(10.0, {});
  EXPECT_TRUE(manager.particlesWanted());
  const auto seed = manager.takeSeedRequest();
  ASSERT_TRUE(seed);
  EXPECT_GE(seed->cov(0, 0), 1.0);  // the GNSS bias is in it
  EXPECT_FALSE(manager.takeSeedRequest());
}

TEST_F(Crossing, AReturnAsksForSeedsAgain) {
  // GIVEN a robot that was inside with authority of the map, and has left the building's
  // surroundings
  for (const bool fixes : {true, false}) {
    SCOPED_TRACE(fixes ? "with GNSS" : "without");
    drive(35.0, {true, 0.0, 0.1, 0.9, 0.0});
    ASSERT_EQ(manager.mode(), Mode::kIndoor);
    drive(10.0, {true, 0.0, 0.1, 0.9, 0.0}, -1.0);
    drive(25.0, {true}, -1.0);
    ASSERT_FALSE(manager.particlesWanted());
    (void)manager.takeSeedRequest();
    // WHEN it comes near again THEN what the particles said then does not count
    drive(25.0, {fixes});
    EXPECT_TRUE(manager.takeSeedRequest());
    drive(25.0, {true}, -1.0);
  }
}

TEST_F(Crossing, AMissionCanForceAModeAndGiveItBack) {
  drive(10.0, {true, 0.0, 0.1, 0.1, 0.0});
  manager.force(Mode::kIndoor);
  drive(0.1, {true, 0.0, 0.1, 0.1, 0.0});
  EXPECT_EQ(manager.mode(), Mode::kIndoor);
  EXPECT_EQ(log.events.back().reason, "forced");
  manager.force(std::nullopt);
  drive(6.0, {true, 0.0, 0.1, 0.1, 0.0});
  EXPECT_EQ(manager.mode(), Mode::kOutdoor);
}

TEST_F(Crossing, ADisagreementIsSlewedNotStepped) {
  drive(31.0, {true, 1.0, 0.3, -1.0, 0.0});  // GNSS is 1 m off to the side
  Pose2 last = manager.published().mean;
  double worst = 0.0;
  for (int i = 0; i < 500; ++i) {
    drive(0.02, {true, 1.0, 0.3, 0.9, 0.0});
    const Pose2 next = manager.published().mean;
    worst = std::max(worst, std::abs(next.y - last.y));
    last = next;
  }
  EXPECT_EQ(manager.mode(), Mode::kIndoor);
  EXPECT_LE(worst, 0.25 * 0.02 + 1e-9);
  EXPECT_NEAR(last.y, 0.0, 0.05);
}

}  // namespace
}  // namespace vestibule::mode_manager
