#include "vestibule/amcl/tell_apart.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace vestibule::amcl {
namespace {

constexpr int kWidth = 480;
constexpr int kHeight = 200;
constexpr double kResolution = 0.05;

/// Two equal rooms of 6 x 6 m side by side, doors to a corridor that goes on for 10 m to the left
/// of them only.
std::shared_ptr<const grid::OccupancyMap> twoRooms(const Pose2& T_map_grid) {
  std::vector<grid::Cell> cells(kWidth * kHeight, grid::Cell::kOccupied);
  const auto clear = [&](int x0, int x1, int y0, int y1) {
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        cells[static_cast<std::size_t>(y * kWidth + x)] = grid::Cell::kFree;
      }
    }
  };
  for (const int x : {220, 340}) {
    clear(x, x + 118, 2, 120);
    clear(x + 50, x + 70, 120, 124);
  }
  clear(4, 460, 124, 180);
  return std::make_shared<const grid::OccupancyMap>(
      grid::OccupancyMap::fromCells(kWidth, kHeight, kResolution, {0, 0}, cells, T_map_grid));
}

Place place(const Pose2& T_map_base, double weight) {
  Place p;
  p.T_map_base.mean = T_map_base;
  p.weight = weight;
  return p;
}

TEST(TellApart, LeadsOutOfARoomThatLooksLikeAnother) {
  const Pose2 T_map_grid{40.0, -7.0, 0.5};
  const auto map = twoRooms(T_map_grid);
  const TellApart tell_apart(map, 0.3, {});
  const Pose2 T_map_left = compose(T_map_grid, Pose2{14.0, 2.0, 0.3});
  const Pose2 T_map_right = compose(T_map_grid, Pose2{20.0, 2.0, 0.3});
  const auto way = tell_apart.way({place(T_map_left, 0.6), place(T_map_right, 0.4)}, 20.0);
  ASSERT_GT(way.size(), 10U);
  // Nothing within the rooms tells them apart.
  const Point2 end = transform(inverse(T_map_grid), way.back());
  EXPECT_GT(end.y, 5.0);
  // It starts at the likelier place and keeps off the walls.
  EXPECT_LT(std::hypot(way.front().x - T_map_left.x, way.front().y - T_map_left.y), 0.2);
  const grid::DistanceField distances(*map);
  double length_m = 0.0;
  for (std::size_t i = 0; i < way.size(); ++i) {
    EXPECT_GT(distances.at(way[i], 1.0), 0.3);
    if (i == 0) continue;
    EXPECT_LT(std::hypot(way[i].x - way[i - 1].x, way[i].y - way[i - 1].y), 0.08);
    length_m += std::hypot(way[i].x - way[i - 1].x, way[i].y - way[i - 1].y);
  }
  EXPECT_LE(length_m, 20.0);
  // Not round corners of its own: the middle of the door is at (14.0, 6.1).
  const Point2 door = transform(T_map_grid, {14.0, 6.1});
  const double straight_m = std::hypot(door.x - T_map_left.x, door.y - T_map_left.y) +
                            std::hypot(way.back().x - door.x, way.back().y - door.y);
  EXPECT_LT(length_m, 1.1 * straight_m);
}

TEST(TellApart, LooksAtTheEndOfACorridorFromAfar) {
  // GIVEN a corridor 35 m long that opens into a hall, and two places in it 9 m apart
  constexpr int kLong = 800;
  std::vector<grid::Cell> cells(kLong * kHeight, grid::Cell::kOccupied);
  for (int y = 2; y < kHeight - 2; ++y) {
    for (int x = 2; x < kLong - 2; ++x) {
      if (x >= 100 && (y < 80 || y >= 128)) continue;
      cells[static_cast<std::size_t>(y * kLong + x)] = grid::Cell::kFree;
    }
  }
  const auto map = std::make_shared<const grid::OccupancyMap>(
      grid::OccupancyMap::fromCells(kLong, kHeight, kResolution, {0, 0}, cells, {}));
  const TellApart tell_apart(map, 0.3, {});
  const Pose2 near{17.0, 5.2, kPi};
  const Pose2 far{26.0, 5.2, kPi};
  // THEN the robot turns before it is in the hall, 12 m ahead: it has seen whether it is there
  const auto way = tell_apart.way({place(near, 0.6), place(far, 0.4)}, 20.0);
  ASSERT_FALSE(way.empty());
  EXPECT_LT(way.back().x, 15.0);
  EXPECT_GT(way.back().x, 7.5);
}

TEST(TellApart, HasNoWayWhenNothingWithinReachDiffers) {
  const auto map = twoRooms({});
  const TellApart tell_apart(map, 0.3, {});
  const Place left = place({14.0, 2.0, 0.3}, 0.6);
  EXPECT_TRUE(tell_apart.way({left}, 20.0).empty()) << "one place";
  EXPECT_TRUE(tell_apart.way({}, 20.0).empty()) << "none";
  EXPECT_TRUE(tell_apart.way({left, place({14.2, 2.1, 0.35}, 0.4)}, 20.0).empty())
      << "one place, known badly";
  EXPECT_TRUE(tell_apart.way({left, place({20.0, 2.0, 0.3}, 0.4)}, 1.0).empty()) << "too far";
  EXPECT_TRUE(tell_apart.way({place({-5.0, 2.0, 0.3}, 0.6), left}, 20.0).empty())
      << "outside of the map";
}

}  // namespace
}  // namespace vestibule::amcl
