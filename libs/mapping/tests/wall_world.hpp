#pragma once

#include <cmath>
#include <vector>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/mapping/scan_node.hpp"

namespace vestibule::mapping {

/// Straight walls and what a laser sees of them.
struct WallWorld {
  struct Wall {
    Point2 a;
    Point2 b;
  };
  std::vector<Wall> walls;

  void box(double x0, double y0, double x1, double y1) {
    walls.push_back({{x0, y0}, {x1, y0}});
    walls.push_back({{x1, y0}, {x1, y1}});
    walls.push_back({{x1, y1}, {x0, y1}});
    walls.push_back({{x0, y1}, {x0, y0}});
  }

  /// Corridors of 2 m around a block of 16 x 10 m, with niches so that places differ.
  static WallWorld ring() {
    WallWorld world;
    world.box(0, 0, 20, 14);
    world.box(2, 2, 18, 12);
    const double niches[][4] = {
        {3, 0, 3.6, 0.4},
        {8, 0, 8.3, 0.5},
        {9.5, 0, 9.7, 0.2},
        {19.5, 3, 20, 3.5},
        {19.7, 8, 20, 9.2},
        {15, 13.6, 16, 14},
        {11, 13.5, 11.2, 14},
        {4, 13.7, 6, 14},
        {0, 10, 0.5, 10.4},
        {0, 5, 0.3, 7}};
    for (const auto& n : niches) world.box(n[0], n[1], n[2], n[3]);
    return world;
  }

  [[nodiscard]] LaserScan scan(const Pose2& T, Timestamp stamp, RandomStream& random) const {
    LaserScan scan;
    scan.stamp = stamp;
    scan.angle_min_rad = -kPi / 2.0;
    scan.angle_step_rad = kPi / 180.0;
    scan.range_max_m = 30.0;
    for (int i = 0; i <= 180; ++i) {
      const double angle = T.phi + scan.angle(static_cast<std::size_t>(i));
      const double dx = std::cos(angle);
      const double dy = std::sin(angle);
      double best = 30.0;
      for (const Wall& w : walls) {
        const double ex = w.b.x - w.a.x;
        const double ey = w.b.y - w.a.y;
        const double det = ex * dy - ey * dx;
        if (std::abs(det) < 1e-12) continue;
        const double ax = w.a.x - T.x;
        const double ay = w.a.y - T.y;
        const double r = (ex * ay - ey * ax) / det;
        const double s = (dx * ay - dy * ax) / det;
        if (r > 0.0 && s >= 0.0 && s <= 1.0) best = std::min(best, r);
      }
      scan.ranges_m.push_back(static_cast<float>(best + random.normal(0.0, 0.01)));
    }
    return scan;
  }
};

/// Rounds of the ring's corridors at 0.5 m/s, two scans per second.
struct RingDrive {
  std::vector<Pose2> truth;
  std::vector<ScanNode> nodes;  ///< with the raw odometry as the estimate

  /// \param slip_m  the odometry jumps by this, and by 20 deg, twice on the way
  RingDrive(double rounds, double slip_m, std::uint64_t seed) {
    const WallWorld world = WallWorld::ring();
    RandomStream random(seed, "ring drive");
    const Point2 corners[] = {{1, 1}, {19, 1}, {19, 13}, {1, 13}};
    Pose2 T{1, 1, 0};
    const auto go = [&](const Pose2& next) {
      T = next;
      truth.push_back(T);
    };
    truth.push_back(T);
    for (int leg = 0; leg < static_cast<int>(std::lround(4.0 * rounds)); ++leg) {
      const Point2 to = corners[(leg + 1) % 4];
      const double yaw = std::atan2(to.y - T.y, to.x - T.x);
      while (std::abs(angleDiff(yaw, T.phi)) > 1e-9) {
        const double turn = std::min(0.3, std::abs(angleDiff(yaw, T.phi)));
        go({T.x, T.y, wrapToPi(T.phi + std::copysign(turn, angleDiff(yaw, T.phi)))});
      }
      while (std::hypot(to.x - T.x, to.y - T.y) > 1e-9) {
        const double d = std::min(0.25, std::hypot(to.x - T.x, to.y - T.y));
        // Not dead straight, as no robot drives.
        const double wobble = 0.1 * std::sin(2.0 * (T.x + T.y));
        go({T.x + d * std::cos(yaw), T.y + d * std::sin(yaw), wrapToPi(yaw + wobble)});
      }
    }
    Pose2 odometry = truth.front();
    for (std::size_t i = 0; i < truth.size(); ++i) {
      if (i > 0) {
        Pose2 step = between(truth[i - 1], truth[i]);
        step.x = 1.03 * step.x + random.normal(0.0, 0.01);
        step.y += random.normal(0.0, 0.005);
        step.phi = 0.96 * step.phi + random.normal(0.0005, 0.004);
        if (slip_m > 0.0 && (i == truth.size() / 3 || i == 2 * truth.size() / 3)) {
          step = compose(step, Pose2{slip_m, 0.3 * slip_m, degToRad(20.0)});
        }
        odometry = compose(odometry, step);
      }
      const Timestamp stamp{static_cast<std::int64_t>(i) * 500'000'000};
      nodes.push_back({world.scan(truth[i], stamp, random), odometry, odometry});
    }
  }

  /// Largest difference from the truth, the first pose laid onto it.
  [[nodiscard]] double worst(const std::vector<ScanNode>& estimate) const {
    double worst = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      worst = std::max(worst, distance(estimate[i].T_map_base, truth[i]));
    }
    return worst;
  }
  [[nodiscard]] double rmse(const std::vector<ScanNode>& estimate) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const double d = distance(estimate[i].T_map_base, truth[i]);
      sum += d * d;
    }
    return std::sqrt(sum / static_cast<double>(truth.size()));
  }
};

}  // namespace vestibule::mapping
