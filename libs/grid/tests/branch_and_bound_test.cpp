#include "vestibule/grid/branch_and_bound.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "vestibule/core/random.hpp"

namespace vestibule::grid {
namespace {

constexpr int kWidth = 43;
constexpr int kHeight = 29;
constexpr double kResolution = 0.1;

ScoreField randomField(std::uint64_t seed, const Pose2& T_map_field = {}) {
  RandomStream rng(seed, "field");
  std::vector<float> scores(kWidth * kHeight);
  for (float& s : scores) s = rng.bernoulli(0.2) ? static_cast<float>(rng.uniform()) : 0.0F;
  return {kWidth, kHeight, kResolution, T_map_field, scores, 2.0};
}

std::vector<Point2> randomPoints(std::uint64_t seed, std::size_t n) {
  RandomStream rng(seed, "points");
  std::vector<Point2> points(n);
  for (Point2& p : points) p = {rng.uniform(-1.2, 1.2), rng.uniform(-1.2, 1.2)};
  return points;
}

struct Problem {
  ScoreField field;
  std::vector<Point2> points;
  SearchWindow window;
  const BaseMask* mask = nullptr;
  std::optional<PosePrior> prior;
  BranchAndBoundParams params;

  [[nodiscard]] std::vector<PoseMatch> solve(int threads = 1) const {
    BranchAndBoundParams p = params;
    p.threads = threads;
    return BranchAndBoundMatcher(p).match(field, points, window, mask, prior);
  }
};

/// Every pose of the lattice, scored one by one; then the same rules for what is a match.
std::vector<PoseMatch> byBruteForce(const Problem& p) {
  double radius = 0.0;
  for (const Point2& q : p.points) radius = std::max(radius, std::hypot(q.x, q.y));
  radius = std::min(radius, p.params.yaw_radius_m);
  const int slices = static_cast<int>(std::ceil(kPi / std::asin(0.5 * kResolution / radius)));
  const Pose2 centre = between(p.field.T_map_field(), p.window.T_map_centre);
  // Best per block: (-score, slice, row, column), so that the smallest is the best.
  using Ranked = std::tuple<double, int, int, int>;
  std::map<std::tuple<int, int, int>, Ranked> best;
  double best_score = 0.0;
  for (int k = 0; k < slices; ++k) {
    const double yaw = wrapToPi(2.0 * kPi * k / slices);
    if (std::abs(angleDiff(yaw, centre.phi)) > p.window.half_yaw_rad + 1e-9) continue;
    for (int iy = 0; iy < kHeight; ++iy) {
      for (int ix = 0; ix < kWidth; ++ix) {
        const Pose2 T{(ix + 0.5) * kResolution, (iy + 0.5) * kResolution, yaw};
        if (std::abs(T.x - centre.x) > p.window.half_x_m + 0.5 * kResolution - 1e-9) continue;
        if (std::abs(T.y - centre.y) > p.window.half_y_m + 0.5 * kResolution - 1e-9) continue;
        if (p.mask != nullptr && !p.mask->any(0, ix, iy)) continue;
        int sum = 0;
        for (const Point2& q : p.points) {
          const double c = std::cos(yaw) / kResolution;
          const double s = std::sin(yaw) / kResolution;
          const int jx = ix + static_cast<int>(std::floor(0.5 + c * q.x - s * q.y));
          const int jy = iy + static_cast<int>(std::floor(0.5 + s * q.x + c * q.y));
          if (jx >= 0 && jy >= 0 && jx < kWidth && jy < kHeight) sum += p.field.value(0, jx, jy);
        }
        const double units = 255.0 * static_cast<double>(p.points.size());
        if (p.prior) {
          const Pose2 T_map = compose(p.field.T_map_field(), T);
          const Eigen::Vector3d e(
              T_map.x - p.prior->T_map_base.x,
              T_map.y - p.prior->T_map_base.y,
              angleDiff(T_map.phi, p.prior->T_map_base.phi));
          const double d2 = std::min(e.dot(p.prior->information * e), p.prior->max_d2);
          sum -= static_cast<int>(std::floor(units * p.prior->weight * d2 + 1e-7));
        }
        const double score = sum / units;
        if (score < p.params.min_score) continue;
        best_score = std::max(best_score, score);
        const int sector = std::min(7, static_cast<int>((yaw / (2.0 * kPi) + 0.5) * 8));
        const Ranked ranked{-score, k, iy, ix};
        const auto [it, is_new] = best.try_emplace({sector, iy / 8, ix / 8}, ranked);
        if (!is_new) it->second = std::min(it->second, ranked);
      }
    }
  }
  std::vector<Ranked> sorted;
  for (const auto& entry : best) sorted.push_back(entry.second);
  std::sort(sorted.begin(), sorted.end());
  if (sorted.size() > static_cast<std::size_t>(4 * p.params.max_matches)) {
    sorted.resize(static_cast<std::size_t>(4 * p.params.max_matches));
  }
  std::vector<PoseMatch> kept;
  for (const auto& [minus_score, k, iy, ix] : sorted) {
    if (-minus_score < p.params.relative_score * best_score - 1e-12) break;
    if (kept.size() == static_cast<std::size_t>(p.params.max_matches)) break;
    const Pose2 T = compose(
        p.field.T_map_field(),
        Pose2{(ix + 0.5) * kResolution, (iy + 0.5) * kResolution, 2.0 * kPi * k / slices});
    const bool separate = std::all_of(kept.begin(), kept.end(), [&](const PoseMatch& m) {
      return distance(m.T_map_base, T) >= p.params.separation_m ||
             std::abs(angleDiff(m.T_map_base.phi, T.phi)) >= p.params.separation_rad;
    });
    if (separate) kept.push_back({T, -minus_score});
  }
  return kept;
}

void expectEqual(const std::vector<PoseMatch>& a, const std::vector<PoseMatch>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_NEAR(a[i].score, b[i].score, 1e-9) << i;
    EXPECT_NEAR(distance(a[i].T_map_base, b[i].T_map_base), 0.0, 1e-9) << i;
    EXPECT_NEAR(angleDiff(a[i].T_map_base.phi, b[i].T_map_base.phi), 0.0, 1e-9) << i;
  }
}

TEST(BranchAndBoundMatcher, FindsWhatBruteForceFindsOnRandomFields) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    Problem p{
        randomField(seed, {1.0, -2.0, 0.4}), randomPoints(seed, 5 + 4 * seed), {}, nullptr, {}, {}};
    p.window = wholeField(p.field);
    p.params.min_score = 0.05;
    p.params.relative_score = 0.5;
    p.params.separation_m = 0.6;
    p.params.max_matches = seed % 2 == 0 ? 3 : 40;
    const auto expected = byBruteForce(p);
    ASSERT_GT(expected.size(), 1U) << seed;
    SCOPED_TRACE(seed);
    expectEqual(p.solve(), expected);
  }
}

TEST(BranchAndBoundMatcher, FindsWhatBruteForceFindsWithWindowMaskAndPrior) {
  RandomStream rng(9, "mask");
  std::vector<std::uint8_t> allowed(kWidth * kHeight);
  for (auto& a : allowed) a = rng.bernoulli(0.3) ? 1 : 0;
  const BaseMask mask(kWidth, kHeight, allowed);
  for (std::uint64_t seed = 11; seed <= 18; ++seed) {
    const Pose2 T_map_field{1.0, -2.0, 0.4};
    Problem p{randomField(seed, T_map_field), randomPoints(seed, 20), {}, &mask, {}, {}};
    p.window = {compose(T_map_field, Pose2{2.05, 1.45, 0.3}), 1.0, 0.7, 1.2};
    PosePrior prior;
    prior.T_map_base = compose(T_map_field, Pose2{1.8, 1.2, 0.1});
    prior.information << 4.0, 1.0, 0.2, 1.0, 2.0, 0.0, 0.2, 0.0, 3.0;
    prior.weight = 0.01;
    prior.max_d2 = 6.0;
    p.prior = prior;
    p.params.min_score = 0.05;
    p.params.relative_score = 0.5;
    p.params.separation_m = 0.3;
    const auto expected = byBruteForce(p);
    ASSERT_GT(expected.size(), 1U) << seed;
    SCOPED_TRACE(seed);
    expectEqual(p.solve(), expected);
  }
}

TEST(BranchAndBoundMatcher, GivesTheSameMatchesForAnyNumberOfThreads) {
  // Scores of 0 and 1 only: many poses score the same, and the order of poses decides.
  RandomStream rng(21, "ties");
  std::vector<float> scores(kWidth * kHeight);
  for (float& s : scores) s = rng.bernoulli(0.3) ? 1.0F : 0.0F;
  Problem p{
      ScoreField(kWidth, kHeight, kResolution, {}, scores, 2.0),
      randomPoints(21, 6),
      {},
      nullptr,
      {},
      {}};
  p.window = wholeField(p.field);
  p.params.min_score = 0.2;
  p.params.separation_m = 0.4;
  const auto one = p.solve(1);
  expectEqual(one, byBruteForce(p));
  for (const int threads : {2, 3, 8}) {
    for (int repeat = 0; repeat < 3; ++repeat) {
      const auto many = p.solve(threads);
      ASSERT_EQ(many.size(), one.size());
      for (std::size_t i = 0; i < one.size(); ++i) {
        EXPECT_EQ(many[i].T_map_base, one[i].T_map_base);
        EXPECT_EQ(many[i].score, one[i].score);
      }
    }
  }
}

/// End points of a lidar in the middle of a 3 x 2 m room with a pillar, or without.
std::vector<Cell> room(bool with_pillar) {
  std::vector<Cell> cells(kWidth * kHeight, Cell::kUnknown);
  for (int iy = 3; iy <= 23; ++iy) {
    for (int ix = 5; ix <= 35; ++ix) {
      const bool wall = iy == 3 || iy == 23 || ix == 5 || ix == 35;
      const bool pillar = with_pillar && ix >= 28 && ix <= 29 && iy >= 8 && iy <= 9;
      cells[static_cast<std::size_t>(iy * kWidth + ix)] =
          wall || pillar ? Cell::kOccupied : Cell::kFree;
    }
  }
  return cells;
}

std::vector<Point2> seenFrom(const OccupancyMap& map, const Pose2& T_map_base) {
  std::vector<Point2> points;
  for (int iy = 0; iy < kHeight; ++iy) {
    for (int ix = 0; ix < kWidth; ix += 2) {
      if (map.cell(ix, iy) != Cell::kOccupied) continue;
      points.push_back(
          transform(inverse(T_map_base), {(ix + 0.5) * kResolution, (iy + 0.5) * kResolution}));
    }
  }
  return points;
}

TEST(BranchAndBoundMatcher, FindsThePoseInARoomAndOnlyThere) {
  const auto map = OccupancyMap::fromCells(kWidth, kHeight, kResolution, {0, 0}, room(true));
  const auto field = ScoreField::fromDistances(map, DistanceField(map), 0.1, kResolution, 5.0);
  const BaseMask mask = BaseMask::freeSpace(field, map);
  const Pose2 truth{1.53, 1.31, 2.2};
  const auto matches =
      BranchAndBoundMatcher({}).match(field, seenFrom(map, truth), wholeField(field), &mask);
  ASSERT_FALSE(matches.empty());
  EXPECT_GT(matches[0].score, 0.8);
  EXPECT_LT(distance(matches[0].T_map_base, truth), 0.1);
  EXPECT_LT(std::abs(angleDiff(matches[0].T_map_base.phi, truth.phi)), degToRad(3.0));
}

TEST(BranchAndBoundMatcher, TellsBothPosesInASymmetricRoom) {
  const auto map = OccupancyMap::fromCells(kWidth, kHeight, kResolution, {0, 0}, room(false));
  const auto field = ScoreField::fromDistances(map, DistanceField(map), 0.1, kResolution, 5.0);
  const Pose2 truth{2.05, 1.35, 0.5};  // the middle: both poses stand in one block
  const auto matches =
      BranchAndBoundMatcher({}).match(field, seenFrom(map, truth), wholeField(field));
  ASSERT_GE(matches.size(), 2U);
  EXPECT_GT(matches[1].score, 0.95 * matches[0].score);
  EXPECT_NEAR(std::abs(angleDiff(matches[0].T_map_base.phi, matches[1].T_map_base.phi)), kPi, 0.1);
}

TEST(BranchAndBoundMatcher, HasNoMatchWithoutPointsOrWindow) {
  Problem p{randomField(1), {}, {}, nullptr, {}, {}};
  p.window = wholeField(p.field);
  EXPECT_TRUE(p.solve().empty());
  p.points = {{50.0, 0.0}};  // beyond the reach
  EXPECT_TRUE(p.solve().empty());
  p.points = randomPoints(1, 10);
  p.window = {{100.0, 0.0, 0.0}, 1.0, 1.0, kPi};  // beside the field
  EXPECT_TRUE(p.solve().empty());
}

TEST(ScoreField, TakesTheBestOfTheMapCellsAndScoresNothingOutside) {
  const auto map =
      OccupancyMap::fromCells(kWidth, kHeight, 0.05, {0.3, 0.2}, room(true), {1, 2, 0.5});
  const DistanceField distances(map);
  const auto field = ScoreField::fromDistances(map, distances, 0.1, 0.1, 2.0);
  EXPECT_EQ(field.width(), (kWidth + 1) / 2);
  EXPECT_NEAR(field.resolution(), 0.1, 1e-6);
  for (int iy = 0; iy < field.height(); ++iy) {
    for (int ix = 0; ix < field.width(); ++ix) {
      double best = 0.0;
      for (int k = 0; k < 4; ++k) {
        const Point2 p = transform(
            map.T_map_grid(), {(2 * ix + k % 2 + 0.5) * 0.05, (2 * iy + k / 2 + 0.5) * 0.05});
        const double d = distances.at(p, 99.0);
        best = std::max(best, std::exp(-0.5 * d * d / 0.01));
      }
      EXPECT_NEAR(field.value(0, ix, iy) / 255.0, best, 0.003);
      EXPECT_DOUBLE_EQ(
          field.at(transform(field.T_map_field(), {(ix + 0.5) * 0.1, (iy + 0.5) * 0.1})),
          field.value(0, ix, iy) / 255.0);
    }
  }
  EXPECT_DOUBLE_EQ(field.at({-50, 0}), 0.0);
}

}  // namespace
}  // namespace vestibule::grid
