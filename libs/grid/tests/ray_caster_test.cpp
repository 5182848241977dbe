#include "vestibule/grid/ray_caster.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::grid {
namespace {

constexpr int kWidth = 40;
constexpr int kHeight = 30;
constexpr double kResolution = 0.1;

TEST(RayCaster, AgreesWithSmallStepsAlongTheRay) {
  RandomStream rng(3, "rays");
  std::vector<Cell> cells(kWidth * kHeight, Cell::kFree);
  for (Cell& cell : cells) {
    if (rng.bernoulli(0.02)) cell = Cell::kOccupied;
  }
  const auto map =
      OccupancyMap::fromCells(kWidth, kHeight, kResolution, {-1.0, 2.0}, cells, {5, 6, 0.7});
  const RayCaster caster(map);
  constexpr double kMax_m = 3.0;
  for (int n = 0; n < 500; ++n) {
    const Point2 from = transform(map.T_map_grid(), {rng.uniform(0.0, 4.0), rng.uniform(0.0, 3.0)});
    const double yaw = rng.uniform(-kPi, kPi);
    double expected = 0.0;
    constexpr double kStep_m = 1e-3;
    while (expected < kMax_m &&
           map.at({from.x + expected * std::cos(yaw), from.y + expected * std::sin(yaw)}) !=
               Cell::kOccupied) {
      expected += kStep_m;
    }
    const double range = caster.range(from, yaw, kMax_m);
    // Small steps jump over corners of cells: the exact ray may only be shorter there.
    EXPECT_LE(range, expected + 1e-9);
    if (range < expected - 2.0 * kStep_m) {
      const Point2 hit{
          from.x + (range + 1e-6) * std::cos(yaw), from.y + (range + 1e-6) * std::sin(yaw)};
      EXPECT_EQ(map.at(hit), Cell::kOccupied) << range << " against " << expected;
    }
  }
}

TEST(RayCaster, EndsAtItsRangeOutsideOfTheMapAndInAnEmptyOne) {
  const auto map = OccupancyMap::fromCells(
      kWidth, kHeight, kResolution, {0, 0}, std::vector<Cell>(kWidth * kHeight, Cell::kUnknown));
  const RayCaster caster(map);
  EXPECT_DOUBLE_EQ(caster.range({1.0, 1.0}, 0.0, 7.5), 7.5);
  EXPECT_DOUBLE_EQ(caster.range({-50.0, 1.0}, kPi, 7.5), 7.5);
  // Where cells can no longer be counted, too.
  EXPECT_DOUBLE_EQ(caster.range({1e12, -1e12}, 0.3, 7.5), 7.5);
  EXPECT_DOUBLE_EQ(caster.range({std::nan(""), 1.0}, 0.3, 7.5), 7.5);
}

TEST(RayCaster, SeesTheMapFromOutside) {
  const auto map = OccupancyMap::fromCells(
      kWidth, kHeight, kResolution, {0, 0}, std::vector<Cell>(kWidth * kHeight, Cell::kOccupied));
  const RayCaster caster(map);
  EXPECT_NEAR(caster.range({-5.0, 1.0}, 0.0, 7.5), 5.0, 1e-9);
  EXPECT_DOUBLE_EQ(caster.range({-5.0, 1.0}, 0.0, 4.9), 4.9);
  EXPECT_DOUBLE_EQ(caster.range({-5.0, 1.0}, 1.0, 7.5), 7.5);
  EXPECT_NEAR(caster.range({3.0, 9.0}, -0.5 * kPi, 7.5), 6.0, 1e-6);
}

TEST(RayCaster, IsZeroInsideAnObstacle) {
  std::vector<Cell> cells(kWidth * kHeight, Cell::kFree);
  cells[5 * kWidth + 7] = Cell::kOccupied;
  const auto map = OccupancyMap::fromCells(kWidth, kHeight, kResolution, {0, 0}, cells);
  const RayCaster caster(map);
  EXPECT_DOUBLE_EQ(caster.range({0.75, 0.55}, 0.3, 9.0), 0.0);
  EXPECT_NEAR(caster.range({0.25, 0.55}, 0.0, 9.0), 0.45, 1e-6);
  EXPECT_NEAR(caster.range({0.75, 2.05}, -kPi / 2.0, 9.0), 1.45, 1e-6);
}

}  // namespace
}  // namespace vestibule::grid
