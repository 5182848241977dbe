#include "scan_integrator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vestibule::mapping {

ScanIntegrator::ScanIntegrator(const FilterMapParams& params)
    : max_range_m_(params.max_range_m),
      half_(static_cast<int>(std::ceil(params.max_range_m / params.resolution_m)) + 2),
      words_((2 * half_ + 63) / 64),
      marks_(static_cast<std::size_t>(words_) * static_cast<std::size_t>(2 * half_), 0) {}

bool ScanIntegrator::mark(int ix, int iy) {
  const int col = ix - x0_;
  const int row = iy - y0_;
  if (col < 0 || row < 0 || col >= 2 * half_ || row >= 2 * half_) return false;
  std::uint64_t& word = marks_
      [static_cast<std::size_t>(row) * static_cast<std::size_t>(words_) +
       static_cast<std::size_t>(col >> 6)];
  const std::uint64_t bit = std::uint64_t{1} << static_cast<unsigned>(col & 63);
  if ((word & bit) != 0) return false;
  word |= bit;
  return true;
}

void ScanIntegrator::integrate(PatchMap& map, const LaserScan& scan, const Pose2& T_map_base) {
  const Pose2 T_map_laser = compose(T_map_base, scan.T_base_laser);
  const double scale = 1.0 / map.resolution();
  const double x = T_map_laser.x * scale;
  const double y = T_map_laser.y * scale;
  x0_ = static_cast<int>(std::floor(x)) - half_;
  y0_ = static_cast<int>(std::floor(y)) - half_;

  struct Beam {
    double dx, dy, length;  // [cells]
  };
  std::vector<Beam> beams;
  beams.reserve(scan.ranges_m.size());
  PatchMap::Writer writer(map);
  double farthest = 0.0;
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const auto range = static_cast<double>(scan.ranges_m[i]);
    if (!scan.valid(i)) continue;  // no echo: a dark or slanted wall gives none either
    const double angle = T_map_laser.phi + scan.angle(i);
    const Beam beam{std::cos(angle), std::sin(angle), std::min(range, max_range_m_) * scale};
    farthest = std::max(farthest, beam.length);
    if (range <= max_range_m_) {
      const double hx = x + beam.dx * beam.length;
      const double hy = y + beam.dy * beam.length;
      const bool first = mark(static_cast<int>(std::floor(hx)), static_cast<int>(std::floor(hy)));
      writer.addHit(hx, hy, first);
    }
    beams.push_back(beam);
  }
  for (const Beam& beam : beams) castFree(writer, x, y, beam.dx, beam.dy, beam.length - 0.5);

  const int reach = std::min(half_, static_cast<int>(farthest) + 2);
  std::fill(
      marks_.begin() + static_cast<std::ptrdiff_t>(half_ - reach) * words_,
      marks_.begin() + static_cast<std::ptrdiff_t>(half_ + reach) * words_,
      0);
}

// Amanatides & Woo, "A fast voxel traversal algorithm for ray tracing", 1987.
void ScanIntegrator::castFree(
    PatchMap::Writer& map, double x, double y, double dx, double dy, double length) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  int ix = static_cast<int>(std::floor(x));
  int iy = static_cast<int>(std::floor(y));
  const int step_x = dx > 0.0 ? 1 : -1;
  const int step_y = dy > 0.0 ? 1 : -1;
  const double per_x = dx != 0.0 ? std::abs(1.0 / dx) : kNever;
  const double per_y = dy != 0.0 ? std::abs(1.0 / dy) : kNever;
  double next_x = dx != 0.0 ? (dx > 0.0 ? ix + 1 - x : x - ix) * per_x : kNever;
  double next_y = dy != 0.0 ? (dy > 0.0 ? iy + 1 - y : y - iy) * per_y : kNever;
  double at = 0.0;
  while (at < length) {
    if (mark(ix, iy)) map.addFree(ix, iy);
    if (next_x < next_y) {
      at = next_x;
      next_x += per_x;
      ix += step_x;
    } else {
      at = next_y;
      next_y += per_y;
      iy += step_y;
    }
  }
}

}  // namespace vestibule::mapping
