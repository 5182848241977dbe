#include "vestibule/amcl/particle_localizer.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "matchers.hpp"
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
