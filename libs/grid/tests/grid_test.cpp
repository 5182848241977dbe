#include <gtest/gtest.h>

#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/grid/distance_field.hpp"
#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::grid {
namespace {

constexpr int kWidth = 37;
constexpr int kHeight = 23;

std::vector<Cell> randomCells(double occupied_share) {
  RandomStream rng(5, "cells");
  std::vector<Cell> cells(kWidth * kHeight);
  for (Cell& cell : cells) {
    const double u = rng.uniform();
    cell = u < occupied_share ? Cell::kOccupied : (u < 0.8 ? Cell::kFree : Cell::kUnknown);
  }
  return cells;
}

TEST(OccupancyMap, KeepsEveryCellInPlaceForAnyResolutionAndOrigin) {
  const auto cells = randomCells(0.2);
  for (const double res : {0.05, 0.0504, 0.1, 0.07}) {
    const auto map =
        OccupancyMap::fromCells(kWidth, kHeight, res, {-1.234, 5.678}, cells, {2, 3, 0.5});
    ASSERT_EQ(map.width(), kWidth) << res;
    ASSERT_EQ(map.height(), kHeight) << res;
    for (int iy = 0; iy < kHeight; ++iy) {
      for (int ix = 0; ix < kWidth; ++ix) {
        const Cell expected = cells[static_cast<std::size_t>(iy * kWidth + ix)];
        EXPECT_EQ(map.cell(ix, iy), expected);
        const Point2 centre =
            transform(Pose2{2, 3, 0.5}, {-1.234 + (ix + 0.5) * res, 5.678 + (iy + 0.5) * res});
        EXPECT_EQ(map.at(centre), expected) << ix << "," << iy << " at " << res;
      }
    }
    EXPECT_EQ(map.at({1000, 0}), Cell::kUnknown);
  }
}

TEST(DistanceField, EqualsTheBruteForceDistance) {
  const auto cells = randomCells(0.02);
  const auto map = OccupancyMap::fromCells(kWidth, kHeight, 0.1, {0, 0}, cells);
  const DistanceField field(map);
  for (int iy = 0; iy < kHeight; ++iy) {
    for (int ix = 0; ix < kWidth; ++ix) {
      double nearest = 1e9;
      for (int jy = 0; jy < kHeight; ++jy) {
        for (int jx = 0; jx < kWidth; ++jx) {
          if (map.cell(jx, jy) != Cell::kOccupied) continue;
          nearest = std::min(nearest, 0.1 * std::hypot(ix - jx, iy - jy));
        }
      }
      EXPECT_NEAR(field.at({(ix + 0.5) * 0.1, (iy + 0.5) * 0.1}, 9.0), nearest, 1e-5);
    }
  }
  EXPECT_DOUBLE_EQ(field.at({-1.0, 0.0}, 9.0), 9.0);
}

TEST(DistanceField, MovesWithTheGeoreference) {
  const auto map = OccupancyMap::fromCells(kWidth, kHeight, 0.1, {0, 0}, randomCells(0.02));
  const Pose2 T_site_map{100, 50, degToRad(30)};
  const DistanceField here(map);
  const DistanceField there(map.movedBy(T_site_map));
  const Point2 p{1.23, 0.77};
  EXPECT_DOUBLE_EQ(here.at(p, 9.0), there.at(transform(T_site_map, p), 9.0));
}

TEST(DistanceField, AMapWithoutObstaclesIsOutsideEverywhere) {
  const auto map = OccupancyMap::fromCells(
      kWidth, kHeight, 0.1, {0, 0}, std::vector<Cell>(kWidth * kHeight, Cell::kFree));
  EXPECT_DOUBLE_EQ(DistanceField(map).at({1, 1}, 7.0), 7.0);
}

TEST(DistanceField, UpdatedFieldIsThatOfTheChangedMap) {
  constexpr int kW = 200;
  constexpr int kH = 150;
  RandomStream rng(11, "changes");
  std::vector<Cell> cells(kW * kH, Cell::kFree);
  for (Cell& cell : cells) {
    if (rng.uniform() < 0.002) cell = Cell::kOccupied;
  }
  auto map = OccupancyMap::fromCells(kW, kH, 0.05, {0, 0}, cells);
  DistanceField field(map);
  for (int change = 0; change < 40; ++change) {
    // A box appears or is taken away, anywhere, also at the border.
    const int x0 = static_cast<int>(rng.uniform() * (kW - 8));
    const int y0 = static_cast<int>(rng.uniform() * (kH - 8));
    const Cell kind = rng.bernoulli(0.4) ? Cell::kOccupied : Cell::kFree;
    for (int iy = y0; iy < y0 + 8; ++iy) {
      for (int ix = x0; ix < x0 + 8; ++ix) cells[static_cast<std::size_t>(iy * kW + ix)] = kind;
    }
    map = OccupancyMap::fromCells(kW, kH, 0.05, {0, 0}, cells);
    field.update(map, {x0, y0, x0 + 7, y0 + 7});
    ASSERT_EQ(field.cells(), DistanceField(map).cells()) << "change " << change;
  }
}

TEST(DistanceField, SeesWhatLiesInTheWay) {
  std::vector<Cell> cells(100 * 40, Cell::kFree);
  for (int iy = 10; iy < 40; ++iy) cells[static_cast<std::size_t>(iy * 100 + 50)] = Cell::kOccupied;
  const auto map = OccupancyMap::fromCells(100, 40, 0.05, {0, 0}, cells);
  const DistanceField field(map);
  constexpr double kCell_m = 0.05;
  EXPECT_NEAR(field.firstObstacle({0.5, 1.0}, {4.5, 1.0}, 0.3), 2.0, kCell_m);
  EXPECT_NEAR(field.firstObstacle({0.5, 1.0}, {2.4, 1.0}, 0.3), 2.0, kCell_m) << "behind the end";
  EXPECT_NEAR(field.firstObstacle({0.5, 1.0}, {2.0, 1.0}, 0.3), 1.8, 1e-9) << "ends before";
  EXPECT_NEAR(field.firstObstacle({0.5, 0.2}, {4.5, 0.2}, 0.3), 4.3, 1e-9) << "below the wall";
}

TEST(DistanceField, SlopeIsThatOfTheBilinearDistance) {
  const auto map = OccupancyMap::fromCells(kWidth, kHeight, 0.05, {0, 0}, randomCells(0.05));
  const DistanceField field(map);
  constexpr double kStep = 1e-6;
  RandomStream rng(12, "points");
  for (int i = 0; i < 100; ++i) {
    const Point2 p{rng.uniform(0.1, 1.7), rng.uniform(0.1, 1.0)};
    const auto here = field.slopeAtGrid(p);
    const auto right = field.slopeAtGrid({p.x + kStep, p.y});
    const auto above = field.slopeAtGrid({p.x, p.y + kStep});
    ASSERT_TRUE(here && right && above);
    EXPECT_NEAR(here->gradient_x, (right->distance_m - here->distance_m) / kStep, 1e-4);
    EXPECT_NEAR(here->gradient_y, (above->distance_m - here->distance_m) / kStep, 1e-4);
  }
  EXPECT_FALSE(field.slopeAtGrid({-0.1, 0.5}));
}

}  // namespace
}  // namespace vestibule::grid
