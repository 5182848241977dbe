#include "scan_integrator.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::mapping {

namespace {

// Beams as near as this to each other [cells] meet every cell between them.
constexpr double kDense = 0.9;

int patchesAcross(int half) { return ((2 * half) >> Patch::kBits) + 2; }

}  // namespace

ScanIntegrator::ScanIntegrator(const FilterMapParams& params, double free_range_m)
    : max_range_m_(params.max_range_m),
      free_range_m_(free_range_m),
      half_(static_cast<int>(std::ceil(params.max_range_m / params.resolution_m)) + 2),
      ends_(patchesAcross(half_)),
      free_(patchesAcross(half_)) {}

void ScanIntegrator::integrate(PatchMap& map, const LaserScan& scan, const Pose2& T_map_base) {
  const Pose2 T_map_laser = compose(T_map_base, scan.T_base_laser);
  const double scale = 1.0 / map.resolution();
  const double x = T_map_laser.x * scale;
  const double y = T_map_laser.y * scale;
  const int px0 = (static_cast<int>(std::floor(x)) - half_) >> Patch::kBits;
  const int py0 = (static_cast<int>(std::floor(y)) - half_) >> Patch::kBits;
  const int x0 = px0 * Patch::kSide;
  const int y0 = py0 * Patch::kSide;

  beams_.assign(scan.ranges_m.size(), {});
  PatchMap::Writer writer(map);
  double low_x = x, high_x = x, low_y = y, high_y = y;
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const auto range = static_cast<double>(scan.ranges_m[i]);
    if (!scan.valid(i)) continue;  // no echo: a dark or slanted wall gives none either
    const double angle = T_map_laser.phi + scan.angle(i);
    Beam& beam = beams_[i];
    beam = {std::cos(angle), std::sin(angle), std::min(range, max_range_m_) * scale};
    const double hx = x + beam.dx * beam.length;
    const double hy = y + beam.dy * beam.length;
    low_x = std::min(low_x, hx);
    high_x = std::max(high_x, hx);
    low_y = std::min(low_y, hy);
    high_y = std::max(high_y, hy);
    if (range > max_range_m_) continue;
    const int ix = static_cast<int>(std::floor(hx)) - x0;
    const int iy = static_cast<int>(std::floor(hy)) - y0;
    writer.addHit(hx, hy, !ends_.test(ix, iy));
    ends_.set(ix, iy);
  }
  castBeams(x - x0, y - y0, std::abs(scan.angle_step_rad), free_range_m_ * scale);

  const auto patchOf = [](double cells) {
    return static_cast<int>(std::floor(cells)) >> Patch::kBits;
  };
  for (int py = patchOf(low_y) - py0; py <= patchOf(high_y) - py0; ++py) {
    for (int px = patchOf(low_x) - px0; px <= patchOf(high_x) - px0; ++px) {
      std::uint32_t* free = free_.patch(px, py);
      std::uint32_t* ends = ends_.patch(px, py);
      std::uint32_t any = 0;
      for (int row = 0; row < Patch::kSide; ++row) {
        free[row] &= ~ends[row];
        any |= free[row];
      }
      if (any != 0) writer.addFree(px + px0, py + py0, free);
      std::fill_n(free, Patch::kSide, 0U);
      std::fill_n(ends, Patch::kSide, 0U);
    }
  }
}

// Near the laser beams lie close: there every second, fourth, ... one meets all cells that the
// others do. Beam i, an odd multiple of 2^k, starts where the beams 2^k to both sides of it end or
// are too far from each other.
void ScanIntegrator::castBeams(double x, double y, double step_rad, double reach) {
  const std::size_t n = beams_.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Beam& beam = beams_[i];
    const double length = std::min(beam.length - 0.5, reach);
    const std::size_t side = i & (~i + 1);  // 2^k
    double from = 0.0;
    if (side != 0 && i + side < n) {
      from = std::min(
          {beams_[i - side].length - 0.5,
           beams_[i + side].length - 0.5,
           kDense / std::max(2.0 * static_cast<double>(side) * step_rad, 1e-6)});
      from = std::max(from, 0.0);
    }
    if (length <= from) continue;
    const double start_x = x + beam.dx * from;
    const double start_y = y + beam.dy * from;
    if (std::abs(beam.dy) > std::abs(beam.dx)) {
      castFree<true>(start_x, start_y, beam.dx, beam.dy, length - from);
    } else {
      castFree<false>(start_x, start_y, beam.dx, beam.dy, length - from);
    }
  }
}

// Column by column (row by row where the beam is steep): of each, the cell that the beam enters and
// the one in which it leaves.
template <bool kSteep>
void ScanIntegrator::castFree(double x, double y, double dx, double dy, double length) {
  const double from = kSteep ? y : x;
  const double along = kSteep ? dy : dx;
  const double across = kSteep ? dx : dy;
  const double other = kSteep ? x : y;
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
  const auto visit = [&](int c, int r) { kSteep ? free_.set(r, c) : free_.set(c, r); };
  for (;; column += step, leaves += slope) {
    const int next = column == end ? last_row : static_cast<int>(leaves >> 32);
    visit(column, row);
    if (next != row) visit(column, next);
    if (column == end) break;
    row = next;
  }
}

}  // namespace vestibule::mapping
