// The shipped obstacle room, seen by a lidar with 16 rings and mapped from its sliced sweeps: what
// a mapping lidar easily loses must be there, and the steep slope must stand at its foot.

#include <gtest/gtest.h>

#include <cmath>

#include "test_files.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/mapping/drive_path.hpp"
#include "vestibule/mapping/map_quality.hpp"
#include "vestibule/sensors/sweep_slice.hpp"
#include "vestibule/sim/scenario.hpp"

namespace vestibule::test {
namespace {

struct SlicedRoom {
  grid::OccupancyMap map;
  std::size_t sweeps = 0;
};

SlicedRoom mapTheRoom() {
  const auto scenario = sim::loadScenario("obstacle_room", shipped("config/scenarios"));
  sim::ScenarioRun run(scenario, 3);
  std::vector<mapping::ScanNode> nodes;
  std::vector<std::pair<Timestamp, Pose2>> truth{{run.simulator().time(), run.simulator().truth()}};
  std::size_t sweeps = 0;
  while (!run.finished()) {
    (void)run.step(std::chrono::milliseconds(10));
    truth.emplace_back(run.simulator().time(), run.simulator().truth());
    for (const LidarSweep& sweep : run.simulator().takeSweeps()) {
      if (++sweeps % 5 != 0) continue;
      // The true pose in the middle of the turn; turning fast would bend the sweep.
      const Timestamp middle = sweep.stamp + std::chrono::milliseconds(50);
      auto at = truth.begin();
      while (at + 1 != truth.end() && (at + 1)->first <= middle) ++at;
      const auto next = at + 1 != truth.end() ? at + 1 : at;
      if (std::abs(angleDiff(next->second.phi, at->second.phi)) > 0.001) continue;
      nodes.push_back({sliceSweep(sweep, {}), at->second, at->second});
    }
  }
  return {mapping::toOccupancyMap(mapping::mapOf(nodes, {}), 0.5), sweeps};
}

int occupiedNear(const grid::OccupancyMap& map, double x, double y, double radius_m) {
  int n = 0;
  const double step = map.resolution();
  for (double dx = -radius_m; dx <= radius_m; dx += step) {
    for (double dy = -radius_m; dy <= radius_m; dy += step) {
      if (map.at({x + dx, y + dy}) == grid::Cell::kOccupied) ++n;
    }
  }
  return n;
}

TEST(SlicedSweeps, KeepPolesAndDrawTheSlopeAtItsFoot) {
  const SlicedRoom room = mapTheRoom();
  ASSERT_GT(room.sweeps, 100U);
  const Point2 poles[] = {{1, 1.2}, {4, 1.5}, {1.2, 3.5}, {3.9, 3.2}, {1.5, 5.2}, {3.6, 4.8}};
  for (const Point2& p : poles) {
    EXPECT_GE(occupiedNear(room.map, p.x, p.y, 0.08), 1) << "pole at " << p.x << ", " << p.y;
  }
  EXPECT_GE(occupiedNear(room.map, 0.5, 6.3, 0.2), 2) << "plant";
  EXPECT_GE(occupiedNear(room.map, 4.5, 0.5, 0.2), 2) << "plant";
  EXPECT_GE(occupiedNear(room.map, 0.6, 2.3, 0.35), 8) << "cube";
  // A slope starts at y = 6.65, for x in [3.6, 4.8]: its foot is a wall without gaps, and nothing
  // stands before it. Behind it single cells remain where it was seen along its face: no second
  // wall.
  int columns = 0;
  int doubled = 0;
  for (double x = 3.75; x <= 4.65; x += 0.05) {
    double first = 5.8;
    while (first < 7.2 && room.map.at({x, first}) != grid::Cell::kOccupied) first += 0.01;
    EXPECT_NEAR(first, 6.65, 0.12) << "x = " << x;
    double behind = 6.80;
    while (behind < 6.95 && room.map.at({x, behind}) != grid::Cell::kOccupied) behind += 0.01;
    ++columns;
    doubled += behind < 6.95 ? 1 : 0;
  }
  EXPECT_LE(doubled, columns / 3);
}

}  // namespace
}  // namespace vestibule::test
