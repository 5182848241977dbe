#include "vestibule/grid/correlative.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

namespace vestibule::grid {
namespace {

constexpr double kResolution = 0.05;
constexpr int kWidth = 200;
constexpr int kHeight = 160;

/// Two long walls along x, and one across at the right end if wanted.
struct Corridor {
  OccupancyMap map;
  ScoreField field;
  explicit Corridor(bool with_end) : map(make(with_end)), field(scores(map)) {}

  static OccupancyMap make(bool with_end) {
    std::vector<Cell> cells(kWidth * kHeight, Cell::kFree);
    for (int iy = 0; iy < kHeight; ++iy) {
      for (int ix = 0; ix < kWidth; ++ix) {
        const bool wall = iy == 60 || iy == 100 || (with_end && ix == 140 && iy > 60 && iy < 100);
        if (wall) cells[static_cast<std::size_t>(iy * kWidth + ix)] = Cell::kOccupied;
      }
    }
    return OccupancyMap::fromCells(kWidth, kHeight, kResolution, {0, 0}, cells, {10, 20, 0.6});
  }
  static ScoreField scores(const OccupancyMap& map) {
    return ScoreField::fromDistances(map, DistanceField(map), 0.08, kResolution, 6.0);
  }
  /// Wall points near the pose, in its frame.
  [[nodiscard]] std::vector<Point2> seenFrom(const Pose2& T_map_base) const {
    std::vector<Point2> points;
    for (int iy = 0; iy < kHeight; ++iy) {
      for (int ix = iy % 3; ix < kWidth; ix += 3) {
        if (map.cell(ix, iy) != Cell::kOccupied) continue;
        const Point2 p = transform(
            compose(inverse(T_map_base), map.T_map_grid()),
            {(ix + 0.5) * kResolution, (iy + 0.5) * kResolution});
        if (std::hypot(p.x, p.y) < 3.0) points.push_back(p);
      }
    }
    return points;
  }
};

TEST(CorrelativeMatcher, FindsThePoseFromABadGuess) {
  const Corridor corridor(true);
  const Pose2 truth = compose(corridor.map.T_map_grid(), Pose2{5.5, 4.1, 0.2});
  const Pose2 guess = compose(truth, Pose2{0.21, -0.17, degToRad(11.0)});
  const auto match = CorrelativeMatcher({}).match(corridor.field, corridor.seenFrom(truth), guess);
  ASSERT_TRUE(match);
  EXPECT_LT(distance(match->T_map_base, truth), 0.03);
  EXPECT_LT(std::abs(angleDiff(match->T_map_base.phi, truth.phi)), degToRad(0.5));
  EXPECT_FALSE(match->at_edge);
  EXPECT_GT(match->score, 0.8);
}

TEST(CorrelativeMatcher, EqualsTheSearchOfTheWholeLattice) {
  // With next to no effective points every cell is as good as the best, so all are refined.
  const Corridor corridor(true);
  const Pose2 truth = compose(corridor.map.T_map_grid(), Pose2{5.5, 4.1, 0.2});
  const auto points = corridor.seenFrom(truth);
  CorrelativeParams flat;
  flat.effective_points = 1e-3;
  for (const Pose2& offset : {Pose2{0.03, 0.02, 0.01}, Pose2{-0.11, 0.13, -0.07}}) {
    const Pose2 guess = compose(truth, offset);
    const auto match = CorrelativeMatcher({}).match(corridor.field, points, guess);
    const auto full = CorrelativeMatcher(flat).match(corridor.field, points, guess);
    ASSERT_TRUE(match && full);
    EXPECT_EQ(match->T_map_base, full->T_map_base);
    // And a flat response has the moments of the window itself: 33 steps of 0.02 m per axis.
    const double half = 16.0;
    const double uniform = 0.02 * 0.02 * (half * (half + 1.0) / 3.0 + 1.0 / 12.0);
    EXPECT_NEAR(full->response.cov(0, 0), uniform, 1e-4);
    EXPECT_NEAR(full->response.cov(1, 1), uniform, 1e-4);
  }
}

TEST(CorrelativeMatcher, KnowsThatACorridorHidesThePositionAlongIt) {
  const Corridor corridor(false);
  const Pose2 truth = compose(corridor.map.T_map_grid(), Pose2{5.0, 4.1, 0.0});
  const auto match = CorrelativeMatcher({}).match(corridor.field, corridor.seenFrom(truth), truth);
  ASSERT_TRUE(match);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(
      match->response.cov.topLeftCorner<2, 2>());
  EXPECT_LT(std::sqrt(eigen.eigenvalues()(0)), 0.06);
  EXPECT_GT(std::sqrt(eigen.eigenvalues()(1)), 0.14);  // uniform over +-0.3 m would be 0.17
  // The free direction is the corridor's, turned with the map.
  const Eigen::Vector2d along(std::cos(0.6), std::sin(0.6));
  EXPECT_GT(std::abs(eigen.eigenvectors().col(1).dot(along)), 0.99);

  // A prior pins it down.
  PosePrior prior;
  prior.T_map_base = truth;
  prior.information = Eigen::Vector3d(400.0, 400.0, 100.0).asDiagonal();
  const auto pinned =
      CorrelativeMatcher({}).match(corridor.field, corridor.seenFrom(truth), truth, prior);
  EXPECT_LT(std::sqrt(pinned->response.cov.topLeftCorner<2, 2>().trace()), 0.08);
}

TEST(CorrelativeMatcher, SaysWhenTheBestPoseIsOnTheRim) {
  const Corridor corridor(true);
  const Pose2 truth = compose(corridor.map.T_map_grid(), Pose2{5.5, 4.1, 0.2});
  const Pose2 guess = compose(truth, Pose2{0.0, 0.4, 0.0});
  const auto match = CorrelativeMatcher({}).match(corridor.field, corridor.seenFrom(truth), guess);
  ASSERT_TRUE(match);
  EXPECT_TRUE(match->at_edge);
  EXPECT_FALSE(CorrelativeMatcher({}).match(corridor.field, {{99.0, 0.0}}, guess));
  // Far beside the field nothing fits, and nothing breaks.
  const auto outside = CorrelativeMatcher({}).match(
      corridor.field, corridor.seenFrom(truth), Pose2{-500.0, 300.0, 1.0});
  ASSERT_TRUE(outside);
  EXPECT_EQ(outside->score, 0.0);
}

}  // namespace
}  // namespace vestibule::grid
