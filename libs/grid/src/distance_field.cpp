#include "vestibule/grid/distance_field.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace vestibule::grid {

DistanceField::DistanceField(const OccupancyMap& map)
    : width_(map.width()),
      height_(map.height()),
      resolution_m_(map.resolution()),
      p_grid_corner_(map.corner()),
      T_grid_map_(inverse(map.T_map_grid())) {
  rebuild(map);
}

void DistanceField::rebuild(const OccupancyMap& map) {
  distance_m_.clear();
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

void DistanceField::update(const OccupancyMap& map, const CellBox& changed) {
  constexpr int kFirstReach = 16;
  if (!distance_m_.empty()) {
    for (int reach = kFirstReach; reach < std::max(width_, height_) / 2; reach *= 2) {
      if (updateWithin(map, changed, reach)) return;
    }
  }
  rebuild(map);
}

bool DistanceField::updateWithin(const OccupancyMap& map, const CellBox& changed, int reach) {
  const auto grown = [&](const CellBox& box, int by) {
    return CellBox{
        std::max(0, box.x0 - by),
        std::max(0, box.y0 - by),
        std::min(width_ - 1, box.x1 + by),
        std::min(height_ - 1, box.y1 + by)};
  };
  const CellBox inner = grown(changed, reach);
  const CellBox outer = grown(inner, reach);
  cv::Mat free_space(outer.y1 - outer.y0 + 1, outer.x1 - outer.x0 + 1, CV_8U);
  std::vector<std::uint8_t> row(static_cast<std::size_t>(width_));
  bool any_obstacle = false;
  for (int iy = outer.y0; iy <= outer.y1; ++iy) {
    (void)map.markFree(iy, row.data());
    std::uint8_t* to = free_space.ptr<std::uint8_t>(iy - outer.y0);
    for (int ix = outer.x0; ix <= outer.x1; ++ix) {
      to[ix - outer.x0] = row[static_cast<std::size_t>(ix)];
      any_obstacle = any_obstacle || to[ix - outer.x0] == 0;
    }
  }
  if (!any_obstacle) return false;
  cv::Mat distance;
  cv::distanceTransform(free_space, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);

  const auto res = static_cast<float>(resolution_m_);
  const auto at = [&](int ix, int iy) {
    return distance.at<float>(iy - outer.y0, ix - outer.x0) * res;
  };
  const auto old = [&](int ix, int iy) -> float& {
    return distance_m_
        [static_cast<std::size_t>(iy) * static_cast<std::size_t>(width_) +
         static_cast<std::size_t>(ix)];
  };
  // Exact where no obstacle outside the outer window can be nearer; and done where the change has
  // died out along the rim of the inner one: what lies beyond is reached only through the rim.
  constexpr int kRim = 2;
  const auto onRim = [&](int ix, int iy) {
    return (inner.x0 > 0 && ix < inner.x0 + kRim) ||
           (inner.x1 < width_ - 1 && ix > inner.x1 - kRim) ||
           (inner.y0 > 0 && iy < inner.y0 + kRim) ||
           (inner.y1 < height_ - 1 && iy > inner.y1 - kRim);
  };
  for (int iy = inner.y0; iy <= inner.y1; ++iy) {
    for (int ix = inner.x0; ix <= inner.x1; ++ix) {
      if (at(ix, iy) > static_cast<float>(reach) * res) return false;
      if (onRim(ix, iy) && at(ix, iy) != old(ix, iy)) return false;
    }
  }
  for (int iy = inner.y0; iy <= inner.y1; ++iy) {
    for (int ix = inner.x0; ix <= inner.x1; ++ix) old(ix, iy) = at(ix, iy);
  }
  return true;
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

double DistanceField::firstObstacle(
    const Point2& from, const Point2& towards, double beyond_m) const {
  const double length_m = std::hypot(towards.x - from.x, towards.y - from.y);
  const double end_m = length_m + beyond_m;
  // Free space is crossed in steps as long as the distance allows.
  for (double along_m = 0.0; along_m < end_m;) {
    const double s = along_m / length_m;
    const double d = atGrid(
        {from.x + s * (towards.x - from.x), from.y + s * (towards.y - from.y)}, resolution_m_);
    if (d < 0.5 * resolution_m_) return along_m;
    along_m += std::max(d, resolution_m_) - 0.25 * resolution_m_;
  }
  return end_m;
}

}  // namespace vestibule::grid
