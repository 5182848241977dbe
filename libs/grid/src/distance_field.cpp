#include "vestibule/grid/distance_field.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace vestibule::grid {

DistanceField::DistanceField(const OccupancyMap& map)
    : width_(map.width()),
      height_(map.height()),
      resolution_m_(map.resolution()),
      p_grid_corner_(map.corner()),
      T_grid_map_(inverse(map.T_map_grid())) {
  cv::Mat free_space(height_, width_, CV_8U);
  bool any_obstacle = false;
  for (int iy = 0; iy < height_; ++iy) {
    auto* row = free_space.ptr<std::uint8_t>(iy);
    for (int ix = 0; ix < width_; ++ix) {
      const bool occupied = map.cell(ix, iy) == Cell::kOccupied;
      row[ix] = occupied ? 0 : 1;
      any_obstacle = any_obstacle || occupied;
    }
  }
  if (!any_obstacle) return;  // at() answers `outside` everywhere
  cv::Mat distance;
  cv::distanceTransform(free_space, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  distance *= resolution_m_;
  distance_m_.assign(distance.begin<float>(), distance.end<float>());
}

double DistanceField::at(const Point2& p_map, double outside_m) const {
  const Point2 p = transform(T_grid_map_, p_map);
  const double fx = std::floor((p.x - p_grid_corner_.x) / resolution_m_);
  const double fy = std::floor((p.y - p_grid_corner_.y) / resolution_m_);
  if (distance_m_.empty() || !(fx >= 0.0 && fy >= 0.0 && fx < width_ && fy < height_)) {
    return outside_m;
  }
  return static_cast<double>(distance_m_
                                 [static_cast<std::size_t>(fy) * static_cast<std::size_t>(width_) +
                                  static_cast<std::size_t>(fx)]);
}

}  // namespace vestibule::grid
