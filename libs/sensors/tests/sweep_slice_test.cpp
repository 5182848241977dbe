#include "vestibule/sensors/sweep_slice.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <optional>

#include "vestibule/core/random.hpp"

namespace vestibule {
namespace {

constexpr double kSensor_m = 0.9;

/// Height of what stands or lies at a place: the beam ends where it gets below it.
using Surface = std::function<double(double x, double y)>;

/// 16 rings, 2 deg apart, 900 azimuths, by marching along each beam in steps.
LidarSweep sweepOf(const Surface& surface, double sigma_m = 0.0, double step_m = 0.05) {
  LidarSweep sweep;
  sweep.T_base_laser.z = kSensor_m;
  RandomStream random(1, "sweep");
  for (int a = 0; a < 900; ++a) {
    const double azimuth = 2.0 * kPi * a / 900.0;
    for (int ring = 0; ring < 16; ++ring) {
      const double elevation = degToRad(-15.0 + 2.0 * ring);
      const Eigen::Vector3d d(
          std::cos(elevation) * std::cos(azimuth),
          std::cos(elevation) * std::sin(azimuth),
          std::sin(elevation));
      const auto below = [&](double r) {
        return kSensor_m + r * d.z() <= surface(r * d.x(), r * d.y());
      };
      for (double r = 0.3; r < 15.0; r += step_m) {
        if (!below(r)) continue;
        double low = r - step_m;
        for (int k = 0; k < 6; ++k) (below(0.5 * (low + r)) ? r : low) = 0.5 * (low + r);
        const double noisy = r + random.normal(0.0, sigma_m);
        sweep.points.push_back({(noisy * d).cast<float>(), 0.0F, ring});
        break;
      }
    }
  }
  return sweep;
}

double rangeAt(const LaserScan& scan, double angle_rad) {
  const auto i =
      static_cast<std::size_t>(std::lround((angle_rad - scan.angle_min_rad) / scan.angle_step_rad));
  return static_cast<double>(scan.ranges_m.at(i % scan.ranges_m.size()));
}

int echoes(const LaserScan& scan, double from_rad, double to_rad) {
  int n = 0;
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    if (scan.angle(i) >= from_rad && scan.angle(i) <= to_rad && scan.valid(i)) ++n;
  }
  return n;
}

TEST(SweepSlice, FlatGroundIsNoObstacle) {
  const LaserScan scan = sliceSweep(sweepOf([](double, double) { return 0.0; }, 0.02), {});
  EXPECT_EQ(scan.ranges_m.size(), 720U);
  EXPECT_EQ(echoes(scan, -kPi, kPi), 0);
}

TEST(SweepSlice, AWallIsWhereItStands) {
  for (const double wall_m : {0.7, 2.0, 6.0, 9.0}) {
    SCOPED_TRACE(wall_m);
    const LaserScan scan =
        sliceSweep(sweepOf([&](double x, double) { return x > wall_m ? 2.5 : 0.0; }, 0.01), {});
    EXPECT_NEAR(rangeAt(scan, 0.0), wall_m, 0.05);
    EXPECT_NEAR(rangeAt(scan, 0.5), wall_m / std::cos(0.5), 0.06);
    EXPECT_EQ(echoes(scan, kPi / 2.0 + 0.2, kPi), 0) << "nothing behind the robot";
  }
}

TEST(SweepSlice, ARampInReachIsGround) {
  // GIVEN a ramp of 15 deg ahead from 1.5 m on, up to 2 m and a wall at its end
  const double rise = std::tan(degToRad(15.0));
  const Surface ramp = [&](double x, double) {
    if (x > 7.0) return 4.0;
    return x > 1.5 ? rise * (x - 1.5) : 0.0;
  };
  const LaserScan scan = sliceSweep(sweepOf(ramp, 0.01), {});
  for (const double angle : {-0.4, -0.1, 0.0, 0.1, 0.4}) {
    SCOPED_TRACE(angle);
    const double range = rangeAt(scan, angle);
    EXPECT_NEAR(range * std::cos(angle), 7.0, 0.15) << "the wall, not the ramp";
  }
}

TEST(SweepSlice, ASteepSlopeIsOneWallAtItsFoot) {
  // GIVEN 0.75 m within 0.35 m, then a wall
  for (const double foot_m : {1.2, 2.0, 3.0}) {
    SCOPED_TRACE(foot_m);
    const Surface slope = [&](double x, double) {
      if (x > foot_m + 0.35) return 2.5;
      return x > foot_m ? (x - foot_m) * 0.75 / 0.35 : 0.0;
    };
    const LaserScan scan = sliceSweep(sweepOf(slope, 0.01), {});
    for (const double angle : {-0.3, 0.0, 0.3}) {
      // From 1.2 m only its upper quarter is seen.
      EXPECT_NEAR(rangeAt(scan, angle) * std::cos(angle), foot_m, 0.15);
    }
  }
}

TEST(SweepSlice, AThinPoleIsKept) {
  // GIVEN a pole of 1 cm at 1.5 m, in the direction of an azimuth
  const double azimuth = 2.0 * kPi * 37 / 900.0;
  const Point2 pole{1.5 * std::cos(azimuth), 1.5 * std::sin(azimuth)};
  const Surface world = [&](double x, double y) {
    return std::hypot(x - pole.x, y - pole.y) < 0.005 ? 1.8 : 0.0;
  };
  const LaserScan scan = sliceSweep(sweepOf(world, 0.01, 0.004), {});
  EXPECT_NEAR(rangeAt(scan, azimuth), 1.5, 0.05);
  EXPECT_LE(echoes(scan, -kPi, kPi), 2);
}

TEST(SweepSlice, DustAndWhatHangsHighAreLeftOut) {
  LidarSweep sweep = sweepOf([](double, double) { return 0.0; });
  sweep.points.push_back({{1.0F, 0.0F, -0.2F}, 0.0F, 5});  // one echo in the air
  for (int k = 0; k < 5; ++k) {                            // a lamp, 2.4 m up
    sweep.points.push_back({{0.0F, 2.0F, 1.5F + 0.02F * static_cast<float>(k)}, 0.0F, 15});
  }
  EXPECT_EQ(echoes(sliceSweep(sweep, {}), -kPi, kPi), 0);
}

TEST(SweepSlice, TheMountIsRespected) {
  // GIVEN the same wall seen by a sensor that is tilted down by 5 deg and turned by 90 deg
  LidarSweep sweep = sweepOf([](double x, double) { return x > 2.0 ? 2.5 : 0.0; });
  const double tilt = degToRad(5.0);
  for (auto& p : sweep.points) {
    const Eigen::Vector3f q = p.p_laser;
    p.p_laser = {
        static_cast<float>(std::cos(tilt)) * q.x() - static_cast<float>(std::sin(tilt)) * q.z(),
        q.y(),
        static_cast<float>(std::sin(tilt)) * q.x() + static_cast<float>(std::cos(tilt)) * q.z()};
  }
  sweep.T_base_laser.pitch = tilt;
  sweep.T_base_laser.yaw = kPi / 2.0;
  sweep.T_base_laser.x = 0.3;
  const LaserScan scan = sliceSweep(sweep, {});
  EXPECT_NEAR(rangeAt(scan, 0.0), 2.0, 0.05);
  EXPECT_EQ(echoes(scan, kPi / 2.0 + 0.2, kPi), 0);
  EXPECT_DOUBLE_EQ(scan.T_base_laser.x, 0.3);
  EXPECT_DOUBLE_EQ(scan.T_base_laser.phi, kPi / 2.0);
}

TEST(SweepSlice, EmptyAndBrokenSweepsGiveNoEchoes) {
  EXPECT_EQ(echoes(sliceSweep({}, {}), -kPi, kPi), 0);
  LidarSweep sweep;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  sweep.points.push_back({{nan, 1.0F, 0.0F}, 0.0F, 0});
  sweep.points.push_back({{1.0F, 0.0F, nan}, 0.0F, 0});
  EXPECT_EQ(echoes(sliceSweep(sweep, {}), -kPi, kPi), 0);
}

}  // namespace
}  // namespace vestibule
