#include "vestibule/sensors/sweep_slice.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "vestibule/sensors/sweep_time.hpp"

namespace vestibule {
namespace {

// Two echoes nearer to each other say nothing about the inclination between them.
constexpr double kMinStep_m = 0.08;
constexpr double kMaxStep_m = 1.0;        // farther apart they need not be one surface, ...
constexpr double kMaxStepPerRange = 0.1;  // ... but rings lie apart in proportion to the range
constexpr double kSupport_m = 0.25;       // two echoes of one obstacle: along the ground
constexpr double kFootHeight_m = 0.5;     // so much of an obstacle tells how it leans, ...
constexpr double kMinLean_m = 0.15;       // ... but not less than this, ...
constexpr double kMinLean = 0.2;          // ... and less than this, run by rise, is upright
constexpr double kMaxLean = 1.2;          // run by rise; more is not one steep surface
constexpr double kHiddenHeight_m = 0.3;   // lowest echo so far above and behind the ground seen
constexpr double kMaxFootShift_m = 0.6;   // it is followed down to its foot this far

/// An echo in the vertical plane of its direction.
struct Echo {
  double r_m = 0.0;        // horizontally from the sensor
  double z_m = 0.0;        // above the base
  double elevation = 0.0;  // tangent, seen from the sensor
  bool obstacle = false;
  double foot_m = 0.0;  // where the obstacle stands
};

/// Of an obstacle whose foot is out of sight, the lowest echoes lean away: it may stand anywhere
/// nearer. So looks a slope from close by, over which only its upper edge shows.
bool leansAtTheBottom(const std::vector<Echo>& echoes, std::size_t first, std::size_t last) {
  const Echo& lowest = echoes[first];
  for (std::size_t i = first + 1; i < last; ++i) {
    const double rise = echoes[i].z_m - lowest.z_m;
    const double run = echoes[i].r_m - lowest.r_m;
    // What lies farther back is not the same surface: a wall behind a pole.
    if (rise >= kMinLean_m && run < kMaxLean * rise) return run > kMinLean * rise;
  }
  return false;
}

/// Where an obstacle stands that is seen as echoes [first, last), one above the other, on ground of
/// height ground_z: a leaning surface is followed down to the ground, a vertical one is there
/// already.
/// \param ground_r  ground was seen up to here
/// \return false: it cannot be told
bool setFeet(
    std::vector<Echo>& echoes,
    std::size_t first,
    std::size_t last,
    double ground_r,
    double ground_z) {
  double n = 0.0, sum_z = 0.0, sum_r = 0.0, sum_zz = 0.0, sum_zr = 0.0;
  double top_z = echoes[first].z_m;
  for (std::size_t i = first; i < last; ++i) {
    const double z = echoes[i].z_m - echoes[first].z_m;
    echoes[i].foot_m = echoes[i].r_m;
    if (z > kFootHeight_m) continue;
    top_z = std::max(top_z, echoes[i].z_m);
    n += 1.0;
    sum_z += z;
    sum_r += echoes[i].r_m;
    sum_zz += z * z;
    sum_zr += z * echoes[i].r_m;
  }
  const double spread = n * sum_zz - sum_z * sum_z;
  if (n < 2.0 || top_z - echoes[first].z_m < kMinLean_m || spread <= 0.0) return true;
  const double lean = (n * sum_zr - sum_z * sum_r) / spread;
  if (lean < kMinLean) {
    const bool hidden = echoes[first].z_m - ground_z > kHiddenHeight_m &&
                        echoes[first].r_m - ground_r > kHiddenHeight_m;
    return !(hidden && leansAtTheBottom(echoes, first, last));
  }
  const double r_first = (sum_r - lean * sum_z) / n;
  const double shift = lean * (echoes[first].z_m - ground_z);
  const double foot = r_first - std::clamp(shift, 0.0, kMaxFootShift_m);
  for (std::size_t i = first; i < last; ++i) {
    // What rises behind the leaning part keeps its own place.
    const double on_it = r_first + lean * (echoes[i].z_m - echoes[first].z_m);
    if (std::abs(echoes[i].r_m - on_it) < kSupport_m) echoes[i].foot_m = foot;
  }
  return true;
}

/// Marks the obstacles of one direction. \param echoes by elevation
void findObstacles(std::vector<Echo>& echoes, const SliceParams& p) {
  const double max_rise = std::tan(p.max_slope_rad);
  double ground_r = 0.0;
  double ground_z = 0.0;
  std::vector<bool> steep(echoes.size(), false);
  for (std::size_t i = 0; i < echoes.size(); ++i) {
    // The next echoes above it that are far enough to tell an inclination: the nearest for low
    // things, farther ones because range noise bends short steps.
    for (const double least : {kMinStep_m, 2.0 * kMinStep_m, 4.0 * kMinStep_m}) {
      std::size_t next = i + 1;
      double step = 0.0;
      while (next < echoes.size()) {
        step = std::hypot(echoes[next].r_m - echoes[i].r_m, echoes[next].z_m - echoes[i].z_m);
        if (step >= least) break;
        ++next;
      }
      const double reach = std::max(kMaxStep_m, kMaxStepPerRange * echoes[i].r_m);
      if (next == echoes.size() || step > reach) continue;
      const double rise = echoes[next].z_m - echoes[i].z_m;
      if (rise <= 0.0 || rise <= max_rise * (echoes[next].r_m - echoes[i].r_m)) continue;
      for (std::size_t k = i; k <= next; ++k) steep[k] = true;
    }
  }
  std::size_t i = 0;
  while (i < echoes.size()) {
    const Echo& e = echoes[i];
    // Ground goes on from ground; below the lidar's lowest ring it reaches to the robot's feet.
    const bool climbs = e.z_m - ground_z > max_rise * std::max(e.r_m - ground_r, 0.0);
    if (!steep[i] && !climbs) {
      if (e.r_m > ground_r) {
        ground_r = e.r_m;
        ground_z = e.z_m;
      }
      ++i;
      continue;
    }
    std::size_t last = i + 1;
    while (last < echoes.size() && steep[i] && steep[last]) ++last;
    // Nothing is known of this direction any more, neither a wall nor free space.
    if (!setFeet(echoes, i, last, ground_r, ground_z)) return;
    for (; i < last; ++i) {
      const double height = echoes[i].z_m - ground_z;
      echoes[i].obstacle = height >= p.min_height_m && height <= p.max_height_m;
    }
  }
}

}  // namespace

void describe(ParamIo& io, SliceParams& p) {
  io.optional("min_height_m", p.min_height_m, nonNegative());
  io.optional("max_height_m", p.max_height_m, positive());
  io.optionalDegrees("max_slope_deg", p.max_slope_rad, inside(0.0, 90.0));
  io.optional("beams", p.beams, within(8, 20000));
  io.optional("max_range_m", p.max_range_m, positive());
  io.optional("min_range_m", p.min_range_m, nonNegative());
  if (p.max_height_m <= p.min_height_m) {
    io.problem("max_height_m", "must be larger than min_height_m");
  }
}

LaserScan sliceSweep(const LidarSweep& sweep, const SliceParams& params) {
  const auto n = static_cast<std::size_t>(params.beams);
  const double step_rad = 2.0 * kPi / static_cast<double>(n);
  const mrpt::math::TPose3D& T = sweep.T_base_laser;
  // Level with the base's ground, turned with the sensor, above its place.
  mrpt::math::TPose3D tilt(0.0, 0.0, T.z, 0.0, T.pitch, T.roll);
  std::vector<std::vector<Echo>> columns(n);
  for (const LidarSweep::Point& point : sweep.points) {
    const mrpt::math::TPoint3D p = tilt.composePoint(
        {static_cast<double>(point.p_laser.x()),
         static_cast<double>(point.p_laser.y()),
         static_cast<double>(point.p_laser.z())});
    const double r = std::hypot(p.x, p.y);
    if (!(r >= params.min_range_m && r < params.max_range_m) || !std::isfinite(p.z)) continue;
    const double turn = std::atan2(p.y, p.x) / step_rad + 0.5 * static_cast<double>(n);
    const auto column = static_cast<std::size_t>(std::lround(turn)) % n;
    columns[column].push_back({r, p.z, (p.z - T.z) / r, false, 0.0});
  }
  for (auto& column : columns) {
    std::stable_sort(column.begin(), column.end(), [](const Echo& a, const Echo& b) {
      return a.elevation < b.elevation;
    });
    findObstacles(column, params);
  }
  LaserScan scan;
  scan.stamp = meanStamp(sweep);
  scan.angle_min_rad = -kPi;
  scan.angle_step_rad = step_rad;
  scan.range_max_m = params.max_range_m;
  scan.T_base_laser = {T.x, T.y, T.yaw};
  scan.ranges_m.assign(n, std::numeric_limits<float>::quiet_NaN());
  for (std::size_t i = 0; i < n; ++i) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Echo& e : columns[i]) {
      if (!e.obstacle || e.foot_m >= nearest) continue;
      // One more echo of the same thing, in this direction or the next.
      int support = -1;
      for (const std::size_t k : {i, (i + 1) % n, (i + n - 1) % n}) {
        for (const Echo& other : columns[k]) {
          if (other.obstacle && std::abs(other.foot_m - e.foot_m) <= kSupport_m) ++support;
        }
      }
      if (support > 0) nearest = e.foot_m;
    }
    if (std::isfinite(nearest)) scan.ranges_m[i] = static_cast<float>(nearest);
  }
  return scan;
}

}  // namespace vestibule
