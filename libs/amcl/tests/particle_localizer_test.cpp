#include "vestibule/amcl/particle_localizer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "matchers.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::amcl {
namespace {

constexpr int kWidth = 240;
constexpr int kHeight = 160;
constexpr double kResolution = 0.05;

/// A 12 x 8 m room with an inner wall and a pillar, so that no pose looks like another.
std::shared_ptr<const grid::OccupancyMap> room(const Pose2& T_map_grid = {}) {
  std::vector<grid::Cell> cells(kWidth * kHeight, grid::Cell::kFree);
  const auto fill = [&](int x0, int x1, int y0, int y1) {
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        cells[static_cast<std::size_t>(y * kWidth + x)] = grid::Cell::kOccupied;
      }
    }
  };
  fill(0, kWidth, 0, 2);
  fill(0, kWidth, kHeight - 2, kHeight);
  fill(0, 2, 0, kHeight);
  fill(kWidth - 2, kWidth, 0, kHeight);
  fill(150, 152, 0, 90);
  fill(60, 70, 100, 104);
  return std::make_shared<const grid::OccupancyMap>(
      grid::OccupancyMap::fromCells(kWidth, kHeight, kResolution, {0, 0}, cells, T_map_grid));
}

/// Marches rays through the cells: slow and obviously right.
LaserScan scanFrom(const grid::OccupancyMap& map, const Pose2& T_map_base, Timestamp stamp) {
  LaserScan scan;
  scan.stamp = stamp;
  scan.angle_min_rad = -kPi * 0.75;
  scan.angle_step_rad = degToRad(1.5);
  scan.range_min_m = 0.1;
  scan.range_max_m = 20.0;
  scan.T_base_laser = {0.2, 0.0, 0.0};
  const Pose2 T_map_laser = compose(T_map_base, scan.T_base_laser);
  for (int i = 0; i < 181; ++i) {
    const double angle = scan.angle(static_cast<std::size_t>(i));
    double range = 0.0;
    while (range < scan.range_max_m) {
      range += 0.01;
      const Point2 p = transform(T_map_laser, {range * std::cos(angle), range * std::sin(angle)});
      if (map.at(p) == grid::Cell::kOccupied) break;
    }
    scan.ranges_m.push_back(static_cast<float>(range));
  }
  return scan;
}

struct Drive {
  std::shared_ptr<const grid::OccupancyMap> map;
  Pose2 truth;
  double t_s = 0.0;

  /// Drives an arc for one scan period, with odometry that over-counts by 3 %.
  void step(ParticleLocalizer& localizer) {
    const Eigen::Vector3d twist(0.1, 0.0, 0.02);
    truth = compose(truth, expSe2(twist));
    t_s += 0.2;
    WheelOdometry odometry;
    odometry.stamp = timestampFromSeconds(t_s);
    odometry.dt_s = 0.2;
    odometry.T_previous_now = expSe2(1.03 * twist);
    localizer.process(odometry);
    localizer.process(scanFrom(*map, truth, odometry.stamp));
  }
};

TEST(ParticleLocalizer, TracksThroughWrongOdometryInAGeoreferencedMap) {
  const Pose2 T_map_grid{100.0, -40.0, degToRad(25.0)};
  Drive drive{room(T_map_grid), compose(T_map_grid, Pose2{2.0, 2.0, 0.0})};
  ParticleLocalizer localizer({}, drive.map, 1);
  Eigen::Matrix3d cov = Eigen::Vector3d(0.04, 0.04, 0.01).asDiagonal();
  localizer.initialise({compose(drive.truth, Pose2{0.15, -0.1, 0.05}), cov});
  for (int i = 0; i < 40; ++i) drive.step(localizer);
  EXPECT_THAT(localizer.pose().mean, poseNear(drive.truth, 0.05, degToRad(1.0)));
  EXPECT_GT(localizer.lastReport().trust, 0.95);
  EXPECT_TRUE(localizer.lastReport().trusted);
}

TEST(ParticleLocalizer, FindsItselfWithoutAnyIdeaWhereItIs) {
  Drive drive{room(), {3.0, 2.0, 0.3}};
  ParticleLocalizer localizer({}, drive.map, 5);
  localizer.initialiseGlobally();
  for (int i = 0; i < 30; ++i) drive.step(localizer);
  EXPECT_THAT(localizer.pose().mean, poseNear(drive.truth, 0.08, degToRad(1.5)));
}

TEST(ParticleLocalizer, DecidesBetweenTwoPlacesByTheScans) {
  // GIVEN two places where the robot may be, the wrong one held for likelier
  Drive drive{room(), {3.0, 2.0, 0.3}};
  ParticleLocalizer localizer({}, drive.map, 6);
  const Eigen::Matrix3d cov = Eigen::Vector3d(0.04, 0.04, 0.01).asDiagonal();
  localizer.initialise({{{{9.5, 6.0, -2.0}, cov}, 0.7}, {{drive.truth, cov}, 0.3}});
  EXPECT_GT(localizer.pose().cov(0, 0), 1.0) << "one place was chosen without a scan";
  // WHEN it drives
  for (int i = 0; i < 20; ++i) drive.step(localizer);
  // THEN the scans have decided
  EXPECT_THAT(localizer.pose().mean, poseNear(drive.truth, 0.05, degToRad(1.0)));
}

TEST(ParticleLocalizer, SaysWhenTheScansDoNotFit) {
  // GIVEN a converged filter
  Drive drive{room(), {3.0, 2.0, 0.3}};
  ParticleLocalizer localizer({}, drive.map, 2);
  localizer.initialise({drive.truth, Eigen::Vector3d(0.01, 0.01, 0.001).asDiagonal()});
  for (int i = 0; i < 5; ++i) drive.step(localizer);
  ASSERT_TRUE(localizer.lastReport().trusted);
  // WHEN the robot is carried to the other room unnoticed
  drive.truth = {9.5, 6.0, -2.0};
  for (int i = 0; i < 15; ++i) drive.step(localizer);
  // THEN the estimate is not trusted
  EXPECT_FALSE(localizer.lastReport().trusted) << localizer.lastReport().trust;
}

/// Takes down what is complained about.
struct Complaints : Observer {
  std::vector<std::string> texts;
  Observers observers;
  Complaints() { observers.attach(*this); }
  void onWarning(const WarningEvent& event) override { texts.push_back(event.text); }
};

TEST(ParticleLocalizer, RefusesMapsWithNothingToLocalizeBy) {
  for (const grid::Cell kind : {grid::Cell::kOccupied, grid::Cell::kUnknown, grid::Cell::kFree}) {
    const std::vector<grid::Cell> cells(100, kind);
    const auto map = std::make_shared<const grid::OccupancyMap>(
        grid::OccupancyMap::fromCells(10, 10, 0.1, {0, 0}, cells));
    EXPECT_THROW(ParticleLocalizer({}, map, 1), InputError);
  }
}

TEST(ParticleLocalizer, SaysWhyScansAreNotUsedAndCarriesOnByOdometry) {
  // GIVEN a filter that tracks
  Complaints complaints;
  Drive drive{room(), {3.0, 2.0, 0.3}};
  ParticleLocalizer localizer({}, drive.map, 2, &complaints.observers);
  const auto about = [](const Pose2& T) {
    return PoseWithCovariance{T, Eigen::Vector3d(0.01, 0.01, 0.001).asDiagonal()};
  };
  localizer.initialise(about(drive.truth));
  for (int i = 0; i < 5; ++i) drive.step(localizer);
  ASSERT_TRUE(complaints.texts.empty());
  const auto bad = [&](const auto& spoil) {
    const Eigen::Vector3d twist(0.1, 0.0, 0.02);
    drive.truth = compose(drive.truth, expSe2(twist));
    drive.t_s += 0.2;
    WheelOdometry odometry;
    odometry.stamp = timestampFromSeconds(drive.t_s);
    odometry.dt_s = 0.2;
    odometry.T_previous_now = expSe2(twist);
    localizer.process(odometry);
    LaserScan scan = scanFrom(*drive.map, drive.truth, odometry.stamp);
    spoil(scan);
    return localizer.process(scan);
  };
  // WHEN scans are of no use THEN each kind is told, and the pose goes on
  const ScanReport blind = bad([](LaserScan& s) {
    for (float& r : s.ranges_m) r = std::numeric_limits<float>::quiet_NaN();
  });
  EXPECT_FALSE(blind.used);
  EXPECT_EQ(blind.unused_reason, "too few beams with an echo");
  const ScanReport no_echo = bad([](LaserScan& s) {
    for (float& r : s.ranges_m) r = std::numeric_limits<float>::infinity();
  });
  EXPECT_EQ(no_echo.unused_reason, "too few beams with an echo");
  const ScanReport nowhere =
      bad([](LaserScan& s) { s.T_base_laser.x = std::numeric_limits<double>::quiet_NaN(); });
  EXPECT_FALSE(nowhere.used);
  EXPECT_EQ(nowhere.unused_reason, "laser pose unknown");
  ASSERT_EQ(complaints.texts.size(), 2U);
  EXPECT_EQ(complaints.texts[0], "scan not used: too few beams with an echo");
  EXPECT_EQ(complaints.texts[1], "scan not used: laser pose unknown");
  EXPECT_THAT(localizer.pose().mean, poseNear(drive.truth, 0.05, degToRad(1.0)));
  // Of an odometry message that is not finite nothing is taken.
  WheelOdometry broken;
  broken.stamp = timestampFromSeconds(drive.t_s);
  broken.T_previous_now.phi = std::numeric_limits<double>::quiet_NaN();
  localizer.process(broken);
  EXPECT_THAT(localizer.pose().mean, poseNear(drive.truth, 0.05, degToRad(1.0)));
  // A scan from before the particles were drawn anew (another map, a door) says nothing about them.
  const LaserScan old = scanFrom(*drive.map, drive.truth, timestampFromSeconds(drive.t_s - 0.1));
  localizer.initialise(about(drive.truth));
  EXPECT_EQ(localizer.process(old).unused_reason, "older than the start in this map");
  // AND good scans count again
  EXPECT_TRUE(bad([](LaserScan&) {}).used);
}

TEST(ParticleLocalizer, GoesOnByScansAloneAndSaysSo) {
  Complaints complaints;
  Drive drive{room(), {3.0, 2.0, 0.3}};
  ParticleLocalizer localizer({}, drive.map, 2, &complaints.observers);
  localizer.initialise({drive.truth, Eigen::Vector3d(0.01, 0.01, 0.001).asDiagonal()});
  for (int i = 0; i < 40; ++i) {
    localizer.process(scanFrom(*drive.map, drive.truth, timestampFromSeconds(0.1 * i)));
  }
  ASSERT_EQ(complaints.texts.size(), 1U) << "said once";
  EXPECT_EQ(complaints.texts[0], "no odometry for a while: only scans move the pose");
  EXPECT_THAT(localizer.pose().mean, poseNear(drive.truth, 0.05, degToRad(1.0)));
}

TEST(ParticleLocalizer, FixesDecideBetweenPlacesThatLookAlike) {
  // GIVEN an empty square room, where a half turn about its centre changes nothing
  std::vector<grid::Cell> cells(160 * 160, grid::Cell::kFree);
  for (int i = 0; i < 160; ++i) {
    for (const int rim : {0, 1, 158, 159}) {
      cells[static_cast<std::size_t>(i * 160 + rim)] = grid::Cell::kOccupied;
      cells[static_cast<std::size_t>(rim * 160 + i)] = grid::Cell::kOccupied;
    }
  }
  const Pose2 T_map_grid{20.0, 5.0, 0.7};
  Drive drive{
      std::make_shared<const grid::OccupancyMap>(
          grid::OccupancyMap::fromCells(160, 160, 0.05, {0, 0}, cells, T_map_grid)),
      compose(T_map_grid, Pose2{2.5, 2.5, 0.3})};
  const Pose2 twin = compose(T_map_grid, Pose2{5.5, 5.5, 0.3 - kPi});
  const Eigen::Matrix3d cov = Eigen::Vector3d(0.01, 0.01, 0.002).asDiagonal();
  const auto run = [&](bool enabled, double offset_m) {
    AmclParams params;
    params.gnss.enabled = enabled;
    Drive d = drive;
    ParticleLocalizer localizer(params, d.map, 3);
    localizer.initialise({{{twin, cov}, 0.6}, {{d.truth, cov}, 0.4}});
    for (int i = 0; i < 12; ++i) {
      d.step(localizer);
      localizer.process(Point2{d.truth.x + offset_m, d.truth.y}, 1.5);
    }
    return distance(localizer.pose().mean, d.truth);
  };
  // THEN fixes with an error of a metre decide it, and only where they are wanted
  EXPECT_LT(run(true, 1.0), 0.1);
  EXPECT_GT(run(false, 1.0), 1.0);
}

TEST(ParticleLocalizer, SameSeedSameParticlesWithAndWithoutObservers) {
  const auto run = [](const Observers* observers, bool disturb) {
    Drive drive{room(), {2.0, 2.0, 0.0}};
    ParticleLocalizer localizer({}, drive.map, 9, observers);
    localizer.initialise({drive.truth, Eigen::Vector3d(0.04, 0.04, 0.01).asDiagonal()});
    // A second filter in between must not disturb the first one's random numbers.
    ParticleLocalizer other({}, drive.map, 10);
    if (disturb) other.initialiseGlobally();
    for (int i = 0; i < 10; ++i) {
      drive.step(localizer);
      if (disturb) other.process(scanFrom(*drive.map, drive.truth, timestampFromSeconds(i)));
    }
    return localizer.pose();
  };
  Observers observers;
  class Counter : public Observer {
   public:
    void onParticles(const ParticlesEvent& event) override {
      ++scans;
      double sum = 0.0;
      for (const double w : event.weights) sum += w;
      EXPECT_NEAR(sum, 1.0, 1e-9);
    }
    int scans = 0;
  } counter;
  observers.attach(counter);
  const auto a = run(nullptr, false);
  const auto b = run(&observers, true);
  EXPECT_EQ(a.mean.x, b.mean.x);
  EXPECT_EQ(a.mean.y, b.mean.y);
  EXPECT_EQ(a.mean.phi, b.mean.phi);
  EXPECT_EQ(a.cov, b.cov);
  EXPECT_EQ(counter.scans, 10);
}

}  // namespace
}  // namespace vestibule::amcl
