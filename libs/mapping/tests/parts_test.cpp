// The smaller parts: deskewing, the path of a drive, map figures, GMapping's names.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <map>

#include "room.hpp"
#include "see_through.hpp"
#include "vestibule/mapping/deskew.hpp"
#include "vestibule/mapping/drive_path.hpp"
#include "vestibule/mapping/finish.hpp"
#include "vestibule/mapping/gmapping_names.hpp"
#include "vestibule/mapping/map_quality.hpp"
#include "vestibule/mapping/mapping_params.hpp"
#include "vestibule/mapping/sessions.hpp"

namespace vestibule::mapping {
namespace {

using test::Room;
using test::RoomDrive;
using test::seeThrough;

TEST(Deskew, UndoesTheMotionDuringAScan) {
  // GIVEN a scan taken in 0.1 s by a robot that drives 1 m/s and turns 1 rad/s
  const Room room;
  constexpr double kSpeed = 1.0;
  constexpr double kRate = 1.0;
  const Pose2 start{3.0, 2.0, 0.4};
  const LaserScan still = room.scanFrom(start);
  LaserScan skewed = still;
  skewed.time_increment_s = 0.1 / 180.0;
  for (std::size_t i = 0; i < skewed.ranges_m.size(); ++i) {
    const double t = static_cast<double>(i) * skewed.time_increment_s;
    const Pose2 then = compose(start, expSe2({kSpeed * t, 0.0, kRate * t}));
    skewed.ranges_m[i] = room.scanFrom(then).ranges_m[i];
  }
  // WHEN it is deskewed
  const LaserScan fixed = deskewed(skewed, kSpeed, kRate);
  // THEN nearly all ranges are what a still robot sees; before, most were not
  std::size_t wrong_before = 0;
  std::size_t wrong_after = 0;
  for (std::size_t i = 0; i < still.ranges_m.size(); ++i) {
    wrong_before += std::abs(skewed.ranges_m[i] - still.ranges_m[i]) > 0.03F ? 1U : 0U;
    wrong_after += std::abs(fixed.ranges_m[i] - still.ranges_m[i]) > 0.03F ? 1U : 0U;
  }
  EXPECT_GT(wrong_before, 80U);
  EXPECT_LT(wrong_after, 8U);
  EXPECT_EQ(fixed.time_increment_s, 0.0);
}

TEST(Deskew, LeavesAScanWithoutBeamTimesAlone) {
  const LaserScan scan = Room().scanFrom({3.0, 2.0, 0.4});
  EXPECT_EQ(deskewed(scan, 1.0, 1.0).ranges_m, scan.ranges_m);
}

TEST(DrivePath, SpreadsWhatTheOdometryIsOffOverTheWay) {
  std::vector<ScanNode> nodes(6);
  for (std::size_t i = 0; i < 6; ++i) nodes[i].T_odom_base = {static_cast<double>(i), 0.0, 0.0};
  // GIVEN used scans 0 and 4, the second 0.4 m to the left of where the odometry puts it
  const auto poses = spreadPath(nodes, {0, 4}, {{1.0, 1.0, 0.0}, {5.0, 1.4, 0.0}});
  EXPECT_NEAR(poses[0].y, 1.0, 1e-12);
  EXPECT_NEAR(poses[1].y, 1.1, 1e-6);
  EXPECT_NEAR(poses[3].y, 1.3, 1e-6);
  EXPECT_NEAR(poses[4].y, 1.4, 1e-12);
  EXPECT_NEAR(poses[5].x, 6.0, 1e-12);
}

TEST(DrivePath, ARobotThatStandsWhileItsOdometryIsResetStandsStill) {
  std::vector<ScanNode> nodes(6);
  for (std::size_t i = 0; i < 4; ++i) nodes[i].T_odom_base = {20.0, -7.0, 2.0};
  // GIVEN an odometry that starts from zero again between scans 3 and 4
  const auto poses = spreadPath(nodes, {0, 4}, {{1.0, 1.0, 0.0}, {1.0, 1.0, 0.0}});
  for (const Pose2& T : poses) EXPECT_NEAR(distance(T, {1.0, 1.0, 0.0}), 0.0, 2e-3);
}

TEST(DrivePath, LinksAreSureWhereScansShowItAndLooseWhereTheyContradict) {
  const RoomDrive drive(30);
  std::vector<ScanNode> nodes;
  for (std::size_t i = 0; i < 30; ++i) {
    nodes.push_back({drive.scans[i], drive.T_odom_base[i], drive.T_map_base[i]});
  }
  const std::vector<std::size_t> used{0, 10, 20};
  const auto chain = chainOf(nodes, used, {});
  ASSERT_EQ(chain.size(), 2U);
  EXPECT_EQ(chain[1].from, 1U);
  EXPECT_EQ(chain[1].to, 2U);
  EXPECT_LT(
      distance(chain[1].T_from_to, between(drive.T_map_base[10], drive.T_map_base[20])), 1e-9);
  EXPECT_GT(chain[1].information(0, 0), 100.0);  // 0.1 m
  // WHEN the estimate of the last one is a metre off
  nodes[20].T_map_base = compose(nodes[20].T_map_base, {1.0, 0.0, 0.3});
  const auto bent = chainOf(nodes, used, {});
  EXPECT_LT(bent[1].information(0, 0), 0.1 * chain[1].information(0, 0));
  EXPECT_EQ(bent[0].information, chain[0].information);
}

TEST(DrivePath, FindsTheStartInAMap) {
  const RoomDrive drive(60);
  std::vector<ScanNode> nodes;
  for (std::size_t i = 0; i < 60; i += 2) {
    nodes.push_back({drive.scans[i], {}, drive.T_map_base[i]});
  }
  const PatchMap map = mapOf(nodes, {});
  const auto found = findInMap(map, drive.scans[31], {});
  ASSERT_TRUE(found);
  EXPECT_LT(distance(*found, drive.T_map_base[31]), 0.02);
  // A scan of another place fits nowhere.
  LaserScan elsewhere = drive.scans[31];
  for (std::size_t i = 0; i < elsewhere.ranges_m.size(); ++i) {
    elsewhere.ranges_m[i] =
        3.0F + 2.0F * static_cast<float>(std::sin(0.35 * static_cast<double>(i)));
  }
  EXPECT_FALSE(findInMap(map, elsewhere, {}));
}

TEST(MapQuality, AMapOfWrongPosesScoresWorse) {
  const RoomDrive drive;
  std::vector<ScanNode> right;
  std::vector<ScanNode> wrong;
  std::vector<ScanNode> held_out;
  RandomStream noise(2, "wrong poses");
  for (std::size_t i = 0; i < drive.scans.size(); ++i) {
    const ScanNode node{drive.scans[i], {}, drive.T_map_base[i]};
    if (i % 3 == 2) {
      held_out.push_back(node);
      continue;
    }
    right.push_back(node);
    wrong.push_back(node);
    wrong.back().T_map_base = compose(
        node.T_map_base,
        {noise.normal(0.0, 0.05), noise.normal(0.0, 0.05), noise.normal(0.0, 0.02)});
  }
  const MapQuality good = judgeMap(mapOf(right, {}), held_out, {});
  const MapQuality bad = judgeMap(mapOf(wrong, {}), held_out, {});
  EXPECT_EQ(good.held_out_scans, 40U);
  EXPECT_GT(good.held_out_log_likelihood, bad.held_out_log_likelihood + 0.05);
  EXPECT_LT(good.entropy_bit, bad.entropy_bit);
  EXPECT_GT(good.held_out_matched_share, 0.95);
}

TEST(MapQuality, AThinPoleStaysInTheMap) {
  Room room;
  room.addPolygon({{6.0, 2.0}, {6.01, 2.0}, {6.01, 2.01}, {6.0, 2.01}});
  std::vector<ScanNode> nodes;
  for (int i = 0; i < 60; ++i) {
    ScanNode node;
    node.T_map_base = {2.0 + 0.06 * i, 2.6, -0.2};
    node.scan = room.scanFrom(node.T_map_base);
    nodes.push_back(node);
  }
  const grid::OccupancyMap map = toOccupancyMap(mapOf(nodes, {}), 0.5);
  EXPECT_EQ(map.at({6.005, 2.005}), grid::Cell::kOccupied);
  EXPECT_EQ(map.at({5.5, 2.3}), grid::Cell::kFree);
  EXPECT_EQ(map.at({-1.0, 2.0}), grid::Cell::kUnknown);
}

TEST(MapQuality, EndPointsSpreadOverCellsMakeOneOfThemOccupied) {
  PatchMap map(0.05, 0.25);
  PatchMap::Writer writer(map);
  // GIVEN a pole that 3 of 10 scans saw in two neighbouring cells, in neither often enough
  const auto look = [&](int hits, int through, int ix) {
    for (int i = 0; i < hits; ++i) writer.addHit(ix + 0.5, 10.5);
    for (int i = 0; i < through; ++i) seeThrough(writer, ix, 10);
  };
  look(2, 8, 10);
  look(1, 9, 11);
  // AND a person who crossed a cell once
  look(1, 9, 20);
  const grid::OccupancyMap drawn = toOccupancyMap(map, 0.2);
  EXPECT_EQ(drawn.at({0.525, 0.525}), grid::Cell::kOccupied);
  EXPECT_EQ(drawn.at({0.575, 0.525}), grid::Cell::kFree);
  EXPECT_EQ(drawn.at({1.025, 0.525}), grid::Cell::kFree);
}

/// What `sessions` scans from one place of the room make, each off by so much.
struct Sessions {
  SessionCells cells;
  grid::OccupancyMap map;
};
Sessions sessionsOff(const std::vector<double>& off_m, std::size_t& seen_cells) {
  const Room room;
  std::map<int, PatchMap> maps;
  std::vector<ScanNode> all;
  for (const double off : off_m) {
    const LaserScan scan = room.scanFrom({3.0, 2.0, 0.4});
    const std::vector<ScanNode> own{{scan, {}, {3.0 + off, 2.0, 0.4}}};
    all.push_back(own.front());
    maps.emplace(static_cast<int>(maps.size()) + 1, mapOf(own, {}));
  }
  const grid::OccupancyMap map = toOccupancyMap(mapOf(all, {}), 0.5);
  seen_cells = map.count(grid::Cell::kFree) + map.count(grid::Cell::kOccupied);
  return {sessionCells(std::move(maps), map), map};
}

TEST(Sessions, CellsKnowWhoSawThem) {
  std::size_t seen_cells = 0;
  const SessionCells one = sessionsOff({0.0}, seen_cells).cells;
  ASSERT_EQ(one.shares.size(), 1U);
  EXPECT_EQ(one.shares[0].cells_seen, seen_cells);
  EXPECT_EQ(one.shares[0].cells_alone, seen_cells);
  EXPECT_EQ(one.shares[0].walls_shared, 0U);

  const auto [two, map] = sessionsOff({0.0, 0.3}, seen_cells);
  std::array<std::size_t, 4> cells{};
  for (int iy = 0; iy < map.height(); ++iy) {
    for (const std::uint16_t bits : two.seenBy(map, iy)) ++cells.at(bits);
  }
  EXPECT_EQ(cells[1] + cells[2] + cells[3], seen_cells);
  EXPECT_EQ(two.shares[0].cells_seen, cells[1] + cells[3]);
  EXPECT_EQ(two.shares[1].cells_seen, cells[2] + cells[3]);
  EXPECT_EQ(two.shares[1].cells_alone, cells[2]);
  EXPECT_GT(cells[3], cells[1] + cells[2]);
}

TEST(Sessions, ASessionInAWrongPlaceStandsOut) {
  std::size_t seen_cells = 0;
  const auto share = [](const SessionShare& s) {
    return static_cast<double>(s.walls_contradicted) / static_cast<double>(s.walls_shared);
  };
  const SessionCells cells = sessionsOff({0.0, 0.02, -0.4}, seen_cells).cells;
  EXPECT_LT(share(cells.shares[0]), 0.05);
  EXPECT_LT(share(cells.shares[1]), 0.05);
  EXPECT_GT(share(cells.shares[2]), 0.2);  // what a single scan of it shows: 0.29
}

TEST(GmappingNames, AreReadAndWrittenIntoTheFilter) {
  const auto params = parseParams<MappingParams>(
      "gmapping: {particles: 40, linearUpdate: 0.4, angularUpdate: 0.2, srr: 0.3, stt: 0.4, "
      "resampleThreshold: 0.3, lsigma: 0.06, delta: 0.1, maxUrange: 12, occ_thresh: 0.4, "
      "temporalUpdate: -1, kernelSize: 1}",
      "mine.yaml");
  EXPECT_EQ(params.filter.particles, 40);
  EXPECT_EQ(params.filter.update_d_m, 0.4);
  EXPECT_EQ(params.filter.update_a_rad, 0.2);
  EXPECT_EQ(params.filter.update_max_s, 0.0);
  EXPECT_EQ(params.filter.resample_below, 0.3);
  EXPECT_EQ(params.filter.odometry.trans_per_trans, 0.3);
  EXPECT_EQ(params.filter.odometry.rot_per_rot, 0.4);
  EXPECT_EQ(params.filter.matcher.sigma_m, 0.06);
  EXPECT_EQ(params.filter.map.resolution_m, 0.1);
  EXPECT_EQ(params.filter.map.max_range_m, 12.0);
  EXPECT_EQ(params.filter.map.occupied_ratio, 0.4);
  EXPECT_THAT(params.gmapping.withoutEffect(), testing::ElementsAre("kernelSize"));
}

TEST(GmappingNames, AWrongNameIsAnError) {
  try {
    (void)parseParams<GmappingNames>("particels: 30", "mine.yaml");
    FAIL();
  } catch (const std::exception& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr("particels: unknown key (did you mean particles?)"));
  }
}

}  // namespace
}  // namespace vestibule::mapping
