#include "vestibule/grid/score_field.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace vestibule::grid {
namespace {

/// Largest of the four squares of the level below that make up a square.
std::vector<std::uint8_t> doubled(
    const std::vector<std::uint8_t>& below, std::size_t stride, std::size_t step) {
  std::vector<std::uint8_t> level(below.size());
  const std::size_t rows = below.size() / stride;
  for (std::size_t y = 0; y < rows; ++y) {
    // Beyond the upper and right edge lies padding of score 0.
    const std::uint8_t* here = below.data() + y * stride;
    const std::uint8_t* above = y + step < rows ? here + step * stride : here;
    std::uint8_t* out = level.data() + y * stride;
    for (std::size_t x = 0; x + step < stride; ++x) {
      out[x] = std::max(std::max(here[x], here[x + step]), std::max(above[x], above[x + step]));
    }
    for (std::size_t x = stride - step; x < stride; ++x) out[x] = std::max(here[x], above[x]);
  }
  return level;
}

}  // namespace

ScoreField::ScoreField(
    int width,
    int height,
    double resolution_m,
    const Pose2& T_map_field,
    const std::vector<float>& scores,
    double reach_m)
    : width_(width),
      height_(height),
      resolution_m_(resolution_m),
      reach_m_(reach_m),
      T_map_field_(T_map_field) {
  assert(scores.size() == static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  constexpr int kSize = 1 << kTop;
  // A point may lie the reach away from a base cell of a square that starts at the edge.
  padding_ = static_cast<int>(std::ceil(reach_m / resolution_m)) + 1 + kSize;
  stride_ = static_cast<std::size_t>((width + 2 * padding_ + kSize - 1) / kSize * kSize);
  const std::size_t rows = static_cast<std::size_t>(height + 2 * padding_);
  levels_[0].assign(stride_ * rows, 0);
  for (int iy = 0; iy < height; ++iy) {
    for (int ix = 0; ix < width; ++ix) {
      const float score = scores
          [static_cast<std::size_t>(iy) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(ix)];
      levels_[0][index(ix, iy)] =
          static_cast<std::uint8_t>(std::lround(std::clamp(score, 0.0F, 1.0F) * kOne));
    }
  }
  for (std::size_t h = 1; h <= kTop; ++h) {
    levels_[h] = doubled(levels_[h - 1], stride_, std::size_t{1} << (h - 1));
  }
  const std::vector<std::uint8_t>& top = levels_[kTop];
  top_by_phase_.resize(top.size());
  for (std::size_t y = 0; y < rows; ++y) {
    for (std::size_t x = 0; x < stride_; ++x) {
      top_by_phase_[y * stride_ + x % kSize * (stride_ / kSize) + x / kSize] = top[y * stride_ + x];
    }
  }
}

ScoreField ScoreField::fromDistances(
    const OccupancyMap& map,
    const DistanceField& distances,
    double sigma_m,
    double cell_m,
    double reach_m,
    double unknown_score) {
  const int factor = std::max(1, static_cast<int>(std::lround(cell_m / map.resolution())));
  const int width = (map.width() + factor - 1) / factor;
  const int height = (map.height() + factor - 1) / factor;
  std::vector<float> scores(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const std::vector<float>& d = distances.cells();  // empty: no obstacle, all scores stay 0
  for (std::size_t i = 0; i < d.size(); ++i) {
    const auto ix = static_cast<int>(i % static_cast<std::size_t>(map.width()));
    const auto iy = static_cast<int>(i / static_cast<std::size_t>(map.width()));
    float& score = scores
        [static_cast<std::size_t>(iy / factor) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(ix / factor)];
    const double u = static_cast<double>(d[i]) / sigma_m;
    const double least = map.cell(ix, iy) == Cell::kUnknown ? unknown_score : 0.0;
    score = std::max(score, static_cast<float>(std::max(least, std::exp(-0.5 * u * u))));
  }
  const Pose2 T_map_field = compose(map.T_map_grid(), Pose2{map.corner().x, map.corner().y, 0.0});
  return {width, height, map.resolution() * factor, T_map_field, scores, reach_m};
}

double ScoreField::at(const Point2& p_map) const {
  const Point2 p = transform(inverse(T_map_field_), p_map);
  const double fx = std::floor(p.x / resolution_m_);
  const double fy = std::floor(p.y / resolution_m_);
  if (!(fx >= 0.0 && fy >= 0.0 && fx < width_ && fy < height_)) return 0.0;
  return static_cast<double>(value(0, static_cast<int>(fx), static_cast<int>(fy))) / kOne;
}

}  // namespace vestibule::grid
