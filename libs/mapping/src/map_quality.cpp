#include "vestibule/mapping/map_quality.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/grid/occupancy_rows.hpp"
#include "vestibule/mapping/scan_matcher.hpp"

namespace vestibule::mapping {

using grid::Cell;

namespace {

constexpr double kHeldOutSigma_m = 0.05;  // of the pose between two used scans
constexpr double kHeldOutSigma_rad = degToRad(1.0);

struct Box {
  int x0 = 0, y0 = 0, x1 = -1, y1 = -1;
};

Box seenCells(const PatchMap& map) {
  const PatchMap::Extent e = map.extent();
  Box box;
  bool any = false;
  for (int iy = e.y0 * Patch::kSide; iy < (e.y0 + e.rows) * Patch::kSide; ++iy) {
    for (int ix = e.x0 * Patch::kSide; ix < (e.x0 + e.columns) * Patch::kSide; ++ix) {
      if (!map.cell(ix, iy).seen()) continue;
      if (!any) box = {ix, iy, ix, iy};
      any = true;
      box = {
          std::min(box.x0, ix), std::min(box.y0, iy), std::max(box.x1, ix), std::max(box.y1, iy)};
    }
  }
  if (!any) box = {0, 0, 0, 0};
  return box;
}

double entropyOf(const PointCell& cell) {
  // One hit and one miss more than counted: a cell seen once is not certain.
  const double p = (cell.hits + 1.0) / (cell.visits + 2.0);
  return -p * std::log2(p) - (1.0 - p) * std::log2(1.0 - p);
}

/// A thin thing whose end points the noise has spread over neighbouring cells: no single one of
/// them is occupied, together they are. True for the cell with the most of them.
bool spreadOut(const PatchMap& map, int ix, int iy) {
  const PointCell middle = map.cell(ix, iy);
  if (middle.hits == 0) return false;
  int hits = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const PointCell cell = map.cell(ix + dx, iy + dy);
      const bool before = dy < 0 || (dy == 0 && dx < 0);
      if (map.occupied(cell) || cell.hits > middle.hits || (before && cell.hits == middle.hits)) {
        return false;
      }
      hits += cell.hits;
    }
  }
  PointCell all = middle;
  all.hits = static_cast<std::uint16_t>(std::min<int>(hits, middle.visits));
  return map.occupied(all);
}

}  // namespace

grid::OccupancyMap toOccupancyMap(const PatchMap& map, double margin_m) {
  Box box = seenCells(map);
  const int rim = static_cast<int>(std::lround(margin_m / map.resolution()));
  box = {box.x0 - rim, box.y0 - rim, box.x1 + rim, box.y1 + rim};
  const int width = box.x1 - box.x0 + 1;
  const int height = box.y1 - box.y0 + 1;
  const auto fill = [&](int row, Cell* cells) {
    const int iy = box.y0 + row;
    for (int ix = box.x0; ix <= box.x1; ++ix) {
      const PointCell cell = map.cell(ix, iy);
      *cells++ = !cell.seen()                                   ? Cell::kUnknown
                 : map.occupied(cell) || spreadOut(map, ix, iy) ? Cell::kOccupied
                                                                : Cell::kFree;
    }
  };
  return grid::occupancyMapFromRows(
      width,
      height,
      map.resolution(),
      {box.x0 * map.resolution(), box.y0 * map.resolution()},
      fill);
}

MapQuality judgeMap(
    const PatchMap& map, const std::vector<ScanNode>& held_out, const MatcherParams& params) {
  MapQuality quality;
  const Box box = seenCells(map);
  std::size_t seen = 0;
  std::size_t area = 0;
  std::size_t outline = 0;
  const auto occupied = [&](int ix, int iy) { return map.occupied(map.cell(ix, iy)); };
  for (int iy = box.y0; iy <= box.y1; ++iy) {
    for (int ix = box.x0; ix <= box.x1; ++ix) {
      const PointCell cell = map.cell(ix, iy);
      if (!cell.seen()) continue;
      ++seen;
      quality.entropy_bit += entropyOf(cell);
      if (!map.occupied(cell)) continue;
      ++area;
      outline += (occupied(ix - 1, iy) ? 0U : 1U) + (occupied(ix + 1, iy) ? 0U : 1U) +
                 (occupied(ix, iy - 1) ? 0U : 1U) + (occupied(ix, iy + 1) ? 0U : 1U);
    }
  }
  if (seen > 0) quality.entropy_bit /= static_cast<double>(seen);
  if (outline > 0) {
    quality.wall_thickness_m =
        map.resolution() * static_cast<double>(area) / (0.5 * static_cast<double>(outline));
  }

  const ScanMatcher matcher(params);
  for (const ScanNode& node : held_out) {
    const ScanPoints points = matchPoints(node.scan, params);
    if (points.points.empty()) continue;
    PosePrior prior;
    prior.mean = node.T_map_base;
    prior.information.diagonal() << std::pow(kHeldOutSigma_m, -2.0),
        std::pow(kHeldOutSigma_m, -2.0), std::pow(kHeldOutSigma_rad, -2.0);
    const Refinement best = matcher.refine(map, points, node.T_map_base, prior);
    const ScanFit fit = matcher.fit(map, points, best.T_map_base);
    const auto beams = static_cast<double>(points.points.size());
    quality.held_out_log_likelihood += fit.log_likelihood / std::min(params.effective_beams, beams);
    quality.held_out_matched_share += fit.matched_share;
    ++quality.held_out_scans;
  }
  if (quality.held_out_scans > 0) {
    const auto n = static_cast<double>(quality.held_out_scans);
    quality.held_out_log_likelihood /= n;
    quality.held_out_matched_share /= n;
  }
  return quality;
}

}  // namespace vestibule::mapping
