#include "likelihood_table.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::amcl {

BeamEnds chooseBeams(const LaserScan& scan, const LikelihoodField& field) {
  std::vector<Point2> spaced;
  Point2 last{1e9, 1e9};
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const auto range = static_cast<double>(scan.ranges_m[i]);
    if (!scan.valid(i) || range > field.max_range_m) continue;
    const Point2 end{range * std::cos(scan.angle(i)), range * std::sin(scan.angle(i))};
    if (std::hypot(end.x - last.x, end.y - last.y) < field.min_spacing_m) continue;
    spaced.push_back(end);
    last = end;
  }
  const std::size_t n = std::min(spaced.size(), static_cast<std::size_t>(field.max_beams));
  BeamEnds beams;
  for (std::size_t k = 0; k < n; ++k) {
    const Point2 p = transform(scan.T_base_laser, spaced[k * spaced.size() / n]);
    beams.x.push_back(static_cast<float>(p.x));
    beams.y.push_back(static_cast<float>(p.y));
  }
  return beams;
}

LikelihoodTable::LikelihoodTable(
    const grid::OccupancyMap& map, const grid::DistanceField& field, const LikelihoodField& params)
    : width_(map.width()),
      height_(map.height()),
      cells_per_m_(1.0 / map.resolution()),
      p_grid_corner_(map.corner()) {
  const auto logOf = [&params](double d) {
    const double u = std::min(d, params.max_distance_m) / params.sigma_hit_m;
    return static_cast<float>(
        std::log(params.z_hit * std::exp(-0.5 * u * u) + params.z_rand / params.max_range_m));
  };
  outside_ = logOf(params.max_distance_m);
  log_likelihood_.assign(
      static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), outside_);
  const std::vector<float>& distances = field.cells();
  for (std::size_t i = 0; i < distances.size(); ++i) {
    log_likelihood_[i] = logOf(static_cast<double>(distances[i]));
  }
}

double LikelihoodTable::logLikelihood(const Pose2& T_grid_base, const BeamEnds& beams) const {
  // In cells; the margin keeps the truncation below a floor for points left of or below the grid.
  constexpr float kMargin = 16384.0F;
  const auto c = static_cast<float>(std::cos(T_grid_base.phi) * cells_per_m_);
  const auto s = static_cast<float>(std::sin(T_grid_base.phi) * cells_per_m_);
  const auto tx = static_cast<float>((T_grid_base.x - p_grid_corner_.x) * cells_per_m_);
  const auto ty = static_cast<float>((T_grid_base.y - p_grid_corner_.y) * cells_per_m_);
  float sum = 0.0F;
  for (std::size_t i = 0; i < beams.size(); ++i) {
    const float fx = tx + c * beams.x[i] - s * beams.y[i];
    const float fy = ty + s * beams.x[i] + c * beams.y[i];
    const int ix = static_cast<int>(fx + kMargin) - static_cast<int>(kMargin);
    const int iy = static_cast<int>(fy + kMargin) - static_cast<int>(kMargin);
    const bool in = ix >= 0 && iy >= 0 && ix < width_ && iy < height_;
    sum += in ? log_likelihood_
                    [static_cast<std::size_t>(iy) * static_cast<std::size_t>(width_) +
                     static_cast<std::size_t>(ix)]
              : outside_;
  }
  return static_cast<double>(sum);
}

}  // namespace vestibule::amcl
