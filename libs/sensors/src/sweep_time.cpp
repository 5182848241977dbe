#include "vestibule/sensors/sweep_time.hpp"

#include <algorithm>

namespace vestibule {

Timestamp meanStamp(const LidarSweep& sweep) {
  double sum_s = 0.0;
  for (const LidarSweep::Point& point : sweep.points) sum_s += double{point.time_offset_s};
  const auto n = static_cast<double>(std::max<std::size_t>(sweep.points.size(), 1));
  return sweep.stamp + durationFromSeconds(sum_s / n);
}

}  // namespace vestibule
