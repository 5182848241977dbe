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
    any_obstacle = map.markFree(iy, free_space.ptr<std::uint8_t>(iy)) || any_obstacle;
  }
  if (!any_obstacle) return;  // at() answers `outside` everywhere
  distance_m_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  cv::Mat distance(height_, width_, CV_32F, distance_m_.data());
  cv::distanceTransform(free_space, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  const auto res = static_cast<float>(resolution_m_);
  for (float& d : distance_m_) d *= res;
}

double DistanceField::at(const Point2& p_map, double outside_m) const {
  return atGrid(transform(T_grid_map_, p_map), outside_m);
}

double DistanceField::atGrid(const Point2& p, double outside_m) const {
  const double fx = std::floor((p.x - p_grid_corner_.x) / resolution_m_);
  const double fy = std::floor((p.y - p_grid_corner_.y) / resolution_m_);
  if (distance_m_.empty() || !(fx >= 0.0 && fy >= 0.0 && fx < width_ && fy < height_)) {
    return outside_m;
  }
  return static_cast<double>(distance_m_
                                 [static_cast<std::size_t>(fy) * static_cast<std::size_t>(width_) +
                                  static_cast<std::size_t>(fx)]);
}

bool DistanceField::blocked(const Point2& from, const Point2& to, double margin_m) const {
  const double length_m = std::hypot(to.x - from.x, to.y - from.y);
  const double end_m = length_m - margin_m;
  // Free space is crossed in steps as long as the distance allows.
  for (double along_m = 0.0; along_m < end_m;) {
    const double s = along_m / length_m;
    const double d =
        atGrid({from.x + s * (to.x - from.x), from.y + s * (to.y - from.y)}, resolution_m_);
    if (d < 0.5 * resolution_m_) return true;
    along_m += std::max(d, resolution_m_) - 0.25 * resolution_m_;
  }
  return false;
}

}  // namespace vestibule::grid
