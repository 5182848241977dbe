#include "vestibule/mapping/patch_map.hpp"

#include <gtest/gtest.h>

#include <optional>

#include "see_through.hpp"
#include "vestibule/mapping/params.hpp"

namespace vestibule::mapping {
namespace {

using test::seeThrough;

TEST(PatchMap, KeepsTheMeanOfTheEndPointsInACell) {
  PatchMap map(0.05);
  PatchMap::Writer writer(map);
  // GIVEN end points in one cell left of and below the origin
  writer.addHit(-3.75, -40.2);
  writer.addHit(-3.25, -40.6);
  // THEN the cell knows their mean, to a fraction of a cell
  const PointCell cell = map.cell(-4, -41);
  EXPECT_EQ(cell.hits, 2);
  EXPECT_EQ(cell.visits, 2);
  EXPECT_NEAR(-4.0 + cell.mean_x / 65536.0, -3.5, 1e-4);
  EXPECT_NEAR(-41.0 + cell.mean_y / 65536.0, -40.4, 1e-4);
  EXPECT_TRUE(map.occupied(cell));
  EXPECT_FALSE(map.cell(-4, -40).seen());
}

TEST(PatchMap, FurtherEndPointsOfAScanMoveOnlyTheMean) {
  PatchMap map(0.05);
  PatchMap::Writer writer(map);
  writer.addHit(0.2, 0.5);
  writer.addHit(0.8, 0.5, false);
  const PointCell cell = map.cell(0, 0);
  EXPECT_EQ(cell.hits, 1);
  EXPECT_EQ(cell.visits, 1);
  EXPECT_NEAR(cell.mean_x / 65536.0, 0.5, 1e-4);
}

TEST(PatchMap, BeamsThroughAWallClearIt) {
  PatchMap map(0.05, 0.25);
  PatchMap::Writer writer(map);
  writer.addHit(5.5, 5.5);
  for (int i = 0; i < 3; ++i) seeThrough(writer, 5, 5);
  EXPECT_TRUE(map.occupied(map.cell(5, 5)));
  seeThrough(writer, 5, 5);
  EXPECT_FALSE(map.occupied(map.cell(5, 5)));
  EXPECT_EQ(map.patch(0, 0)->occupied_rows[5], 0U);
}

TEST(PatchMap, ForgetsWhenTheCountsAreFull) {
  PatchMap map(0.05, 0.25, 20);
  PatchMap::Writer writer(map);
  for (int i = 0; i < 1000; ++i) writer.addHit(1.5, 1.5);
  EXPECT_LE(map.cell(1, 1).visits, 20);
  // GIVEN a wall seen a thousand times and then taken away
  for (int i = 0; i < 60; ++i) seeThrough(writer, 1, 1);
  EXPECT_FALSE(map.occupied(map.cell(1, 1)));
}

TEST(PatchMap, CopiesShareUntilOneIsWritten) {
  PatchMap map(0.05);
  PatchMap::Writer(map).addHit(1.5, 1.5);
  PatchMap::Writer(map).addHit(100.5, 1.5);
  // WHEN a copy is written in one of two patches
  PatchMap copy = map;
  EXPECT_EQ(copy.patch(0, 0), map.patch(0, 0));
  PatchMap::Writer(copy).addHit(2.5, 1.5);
  // THEN only that patch is its own, and the original has not changed
  EXPECT_NE(copy.patch(0, 0), map.patch(0, 0));
  EXPECT_EQ(copy.patch(3, 0), map.patch(3, 0));
  EXPECT_EQ(copy.cell(2, 1).hits, 1);
  EXPECT_EQ(map.cell(2, 1).hits, 0);
  EXPECT_EQ(copy.cell(1, 1).hits, 1);
}

TEST(PatchMap, OwnersMayGoInAnyOrder) {
  std::optional<PatchMap> first(std::in_place, 0.05);
  PatchMap::Writer(*first).addHit(1.5, 1.5);
  PatchMap second = *first;
  first.reset();
  // WHEN the last owner writes it does so in place
  const Patch* before = second.patch(0, 0);
  PatchMap::Writer(second).addHit(1.5, 1.5);
  EXPECT_EQ(second.patch(0, 0), before);
  EXPECT_EQ(second.cell(1, 1).hits, 2);
}

}  // namespace
}  // namespace vestibule::mapping
