#include "likelihood_table.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::amcl {

LikelihoodTable::LikelihoodTable(
    const grid::OccupancyMap& map, const grid::DistanceField& field, const LikelihoodField& params)
    : width_(map.width() + 2),
      height_(map.height() + 2),
      cells_per_m_(static_cast<float>(1.0 / map.resolution())),
      fixed_per_m_(cells_per_m_ * (1 << kFractionBits)),
      corner_x_(static_cast<float>(map.corner().x)),
      corner_y_(static_cast<float>(map.corner().y)) {
  const auto logOf = [&params](double d) {
    const double u = std::min(d, params.max_distance_m) / params.sigma_hit_m;
    return std::log(params.z_hit * std::exp(-0.5 * u * u) + params.z_rand / params.max_range_m);
  };
  constexpr double kLargest = 65535.0;
  smallest_ = logOf(params.max_distance_m);
  step_ = std::max(logOf(0.0) - smallest_, 1e-9) / kLargest;

  // Squared distances between cell centres are whole numbers of cells.
  const double reach = params.max_distance_m / map.resolution();
  std::vector<std::uint16_t> by_squared_cells(static_cast<std::size_t>(reach * reach) + 2, 0);
  for (std::size_t i = 0; i + 1 < by_squared_cells.size(); ++i) {
    const double d = std::sqrt(static_cast<double>(i)) * map.resolution();
    by_squared_cells[i] = static_cast<std::uint16_t>(std::lround((logOf(d) - smallest_) / step_));
  }
  const auto farthest = static_cast<float>(by_squared_cells.size() - 1);

  values_.assign(
      static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_) + 1, std::uint16_t{0});
  const std::vector<float>& distances = field.cells();
  if (distances.empty()) return;
  const auto columns = static_cast<std::size_t>(map.width());
  for (std::size_t iy = 0; iy < static_cast<std::size_t>(map.height()); ++iy) {
    const float* from = distances.data() + iy * columns;
    std::uint16_t* to = values_.data() + (iy + 1) * static_cast<std::size_t>(width_) + 1;
    for (std::size_t ix = 0; ix < columns; ++ix) {
      const float cells = from[ix] * cells_per_m_;
      const float squared = std::min(cells * cells + 0.5F, farthest);
      to[ix] = by_squared_cells[static_cast<std::size_t>(squared)];
    }
  }
}

double LikelihoodTable::logLikelihood(
    const Pose2& T_grid_base, const std::vector<Point2>& ends) const {
  const double c = std::cos(T_grid_base.phi);
  const double s = std::sin(T_grid_base.phi);
  std::vector<std::int32_t> beam_x;
  std::vector<std::int32_t> beam_y;
  for (const Point2& p : ends) {
    beam_x.push_back(fixedLength(static_cast<float>(c * p.x - s * p.y)));
    beam_y.push_back(fixedLength(static_cast<float>(s * p.x + c * p.y)));
  }
  const std::int32_t x = fixedX(static_cast<float>(T_grid_base.x));
  const std::int32_t y = fixedY(static_cast<float>(T_grid_base.y));
  std::uint32_t sum = 0;
  sumOverBeams(
      view(), beam_x.data(), beam_y.data(), ends.size(), &x, &y, 1, false, &sum, Simd::kPortable);
  return logLikelihood(sum, ends.size());
}

}  // namespace vestibule::amcl
