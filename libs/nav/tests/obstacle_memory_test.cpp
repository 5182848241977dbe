#include "vestibule/nav/obstacle_memory.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace vestibule::nav {
namespace {

const Point2 kLaser{0.35, 0.0};

Timestamp at(double s) { return timestampFromSeconds(s); }

/// True if some point lies within 0.08 m of p.
bool has(const std::vector<Point2>& points, const Point2& p) {
  return std::any_of(points.begin(), points.end(), [&](const Point2& q) {
    return std::hypot(p.x - q.x, p.y - q.y) < 0.08;
  });
}

class Memory : public ::testing::Test {
 protected:
  ObstacleMemory memory{ObstacleMemoryParams{}, Footprint{}};
  /// Sees a post at odom (1, 0.8) from the origin, as often as it takes to believe it.
  void seePost() {
    for (int i = 0; i < 3; ++i) {
      (void)memory.update(at(0.1 * i), {0, 0, 0}, {{1.0, 0.8}}, kLaser);
    }
  }
};

TEST_F(Memory, KeepsWhatHasSlippedOutOfView) {
  seePost();
  // The robot has passed it: the post is behind, and the scan sees something else.
  const auto all = memory.update(at(2.0), {1.4, 0.0, 0.0}, {{3.0, 0.0}, {3.0, 0.05}}, kLaser);
  EXPECT_TRUE(has(all, {-0.4, 0.8}));
  EXPECT_TRUE(has(all, {3.0, 0.0}));
}

TEST_F(Memory, ForgetsWhatIsGoneWhenItLooksThereAgain) {
  seePost();
  const auto all = memory.update(at(1.0), {0, 0, 0}, {{1.65, 1.6}, {1.63, 1.62}}, kLaser);
  EXPECT_FALSE(has(all, {1.0, 0.8}));
}

TEST_F(Memory, IgnoresASingleStrayEchoButBelievesTheSecondOne) {
  const Point2 stray{1.0, 0.8};
  (void)memory.update(at(0.0), {0, 0, 0}, {}, kLaser);
  EXPECT_FALSE(has(memory.update(at(0.1), {0, 0, 0}, {stray}, kLaser), stray));
  EXPECT_FALSE(has(memory.update(at(0.2), {0, 0, 0}, {}, kLaser), stray));
  EXPECT_FALSE(has(memory.update(at(0.3), {0, 0, 0}, {stray}, kLaser), stray));
  // Seen twice running, or by two beams at once: a thin post.
  EXPECT_TRUE(has(memory.update(at(0.4), {0, 0, 0}, {stray}, kLaser), stray));
  const Point2 post{2.0, -1.0};
  EXPECT_TRUE(has(memory.update(at(0.5), {0, 0, 0}, {post, {2.02, -0.97}}, kLaser), post));
}

TEST_F(Memory, ForgetsWithAgeWithDistanceAndUnderTheRobot) {
  seePost();
  EXPECT_TRUE(has(memory.update(at(29.0), {0, 0, 0}, {}, kLaser), {1.0, 0.8}));
  EXPECT_FALSE(has(memory.update(at(31.0), {0, 0, 0}, {}, kLaser), {1.0, 0.8}));
  seePost();
  EXPECT_TRUE(memory.update(at(1.0), {9.0, 0, 0}, {}, kLaser).empty());
  seePost();
  EXPECT_TRUE(memory.update(at(1.0), {1.0, 0.7, 0}, {}, kLaser).empty());
}

TEST_F(Memory, DoesNotGrowWhileTheRobotStands) {
  std::vector<Point2> wall;
  for (int i = -60; i <= 60; ++i) wall.push_back({1.0, 0.025 * i});
  std::size_t most = 0;
  for (int k = 0; k < 200; ++k) {
    most = std::max(most, memory.update(at(0.1 * k), {0, 0, 0}, wall, kLaser).size());
  }
  EXPECT_EQ(most, wall.size());
}

}  // namespace
}  // namespace vestibule::nav
