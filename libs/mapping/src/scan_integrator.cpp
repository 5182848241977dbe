#include "scan_integrator.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::mapping {

ScanIntegrator::ScanIntegrator(const FilterMapParams& params, double free_range_m)
    : max_range_m_(params.max_range_m),
      free_range_m_(free_range_m),
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
  const double reach_free = free_range_m_ * scale;
  for (const Beam& beam : beams) {
    castFree(writer, x, y, beam.dx, beam.dy, std::min(beam.length - 0.5, reach_free));
  }

  const int reach = std::min(half_, static_cast<int>(farthest) + 2);
  std::fill(
      marks_.begin() + static_cast<std::ptrdiff_t>(half_ - reach) * words_,
      marks_.begin() + static_cast<std::ptrdiff_t>(half_ + reach) * words_,
      0);
}

// Column by column (row by row where the beam is steep): of each, the cell that the beam enters and
// the one in which it leaves.
void ScanIntegrator::castFree(
    PatchMap::Writer& map, double x, double y, double dx, double dy, double length) {
  if (length <= 0.0) return;
  const bool steep = std::abs(dy) > std::abs(dx);
  const double from = steep ? y : x;
  const double along = steep ? dy : dx;
  const double across = steep ? dx : dy;
  const double other = steep ? x : y;
  const int step = along > 0.0 ? 1 : -1;
  const int end = static_cast<int>(std::floor(from + along * length));
  const int last_row = static_cast<int>(std::floor(other + across * length));
  int column = static_cast<int>(std::floor(from));
  int row = static_cast<int>(std::floor(other));
  // The other coordinate where the beam leaves the column, with 32 bits after the point.
  constexpr double kOne = 4294967296.0;
  const double border = column + (step > 0 ? 1 : 0) - from;
  auto leaves = static_cast<std::int64_t>(std::floor((other + border * across / along) * kOne));
  const auto slope = static_cast<std::int64_t>(across / std::abs(along) * kOne);
  const auto visit = [&](int c, int r) {
    const int ix = steep ? r : c;
    const int iy = steep ? c : r;
    if (mark(ix, iy)) map.addFree(ix, iy);
  };
  for (;; column += step, leaves += slope) {
    const int next = column == end ? last_row : static_cast<int>(leaves >> 32);
    visit(column, row);
    if (next != row) visit(column, next);
    if (column == end) break;
    row = next;
  }
}

}  // namespace vestibule::mapping
