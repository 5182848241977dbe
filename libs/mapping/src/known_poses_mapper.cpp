#include "vestibule/mapping/known_poses_mapper.hpp"

#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/poses/CPose3D.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include "vestibule/core/angles.hpp"

namespace vestibule::mapping {

using grid::Cell;

namespace {

constexpr double kInitialHalfSize_m = 5.0;

/// MRPT spreads beams evenly and symmetrically about the sensor's x axis: what remains of the
/// scan's middle direction goes into the sensor's yaw.
mrpt::obs::CObservation2DRangeScan toMrpt(const LaserScan& scan) {
  mrpt::obs::CObservation2DRangeScan obs;
  const std::size_t n = scan.ranges_m.size();
  obs.resizeScanAndAssign(n, 0.0F, false);
  for (std::size_t i = 0; i < n; ++i) {
    if (!scan.valid(i)) continue;
    obs.setScanRange(i, scan.ranges_m[i]);
    obs.setScanRangeValidity(i, true);
  }
  const double span = static_cast<double>(n - 1) * scan.angle_step_rad;
  obs.aperture = static_cast<float>(std::abs(span));
  obs.rightToLeft = scan.angle_step_rad >= 0.0;
  obs.maxRange = static_cast<float>(scan.range_max_m);
  obs.sensorPose = mrpt::poses::CPose3D(
      scan.T_base_laser.x,
      scan.T_base_laser.y,
      0.0,
      wrapToPi(scan.T_base_laser.phi + scan.angle_min_rad + span / 2.0));
  return obs;
}

}  // namespace

void describe(ParamIo& io, KnownPosesParams& params) {
  io.optional("resolution_m", params.resolution_m, Bounds{0.005, 1.0});
  io.optional("max_range_m", params.max_range_m, positive());
  io.optional("p_hit", params.p_hit, inside(0.5, 1.0));
  io.optional("p_pass", params.p_pass, inside(0.5, 1.0));
  io.optional("margin_m", params.margin_m, nonNegative());
}

struct KnownPosesMapper::Impl {
  mrpt::maps::COccupancyGridMap2D grid;
};

KnownPosesMapper::KnownPosesMapper(const KnownPosesParams& params)
    : params_(params), impl_(std::make_unique<Impl>()) {
  constexpr auto kHalf = static_cast<float>(kInitialHalfSize_m);
  impl_->grid.setSize(-kHalf, kHalf, -kHalf, kHalf, static_cast<float>(params_.resolution_m));
  auto& options = impl_->grid.insertionOptions;
  options.maxDistanceInsertion = static_cast<float>(params_.max_range_m);
  options.maxOccupancyUpdateCertainty = static_cast<float>(params_.p_hit);
  options.maxFreenessUpdateCertainty = static_cast<float>(params_.p_pass);
  options.considerInvalidRangesAsFreeSpace = false;
  // Widened beams would erase thin obstacles beside them.
  options.wideningBeamsWithDistance = false;
}

KnownPosesMapper::~KnownPosesMapper() = default;

void KnownPosesMapper::add(const Pose2& T_map_base, const LaserScan& scan) {
  ++scan_count_;
  if (scan.ranges_m.size() < 2) return;
  const mrpt::poses::CPose3D pose(toPose3(T_map_base));
  impl_->grid.insertObservation(toMrpt(scan), pose);
}

grid::OccupancyMap KnownPosesMapper::build() const {
  assert(scan_count_ > 0);
  const auto view =
      grid::OccupancyMap(std::make_shared<mrpt::maps::COccupancyGridMap2D>(impl_->grid), Pose2{});
  // The part that was seen, with its rim.
  int x0 = view.width();
  int x1 = -1;
  int y0 = view.height();
  int y1 = -1;
  for (int iy = 0; iy < view.height(); ++iy) {
    for (int ix = 0; ix < view.width(); ++ix) {
      if (view.cell(ix, iy) == Cell::kUnknown) continue;
      x0 = std::min(x0, ix);
      x1 = std::max(x1, ix);
      y0 = std::min(y0, iy);
      y1 = std::max(y1, iy);
    }
  }
  if (x1 < x0) x0 = y0 = x1 = y1 = 0;  // no scan had a valid beam: one unknown cell and its rim
  const int rim = static_cast<int>(std::lround(params_.margin_m / params_.resolution_m));
  x0 -= rim;
  y0 -= rim;
  const int width = x1 + rim - x0 + 1;
  const int height = y1 + rim - y0 + 1;
  std::vector<Cell> cells;
  cells.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int iy = y0; iy < y0 + height; ++iy) {
    for (int ix = x0; ix < x0 + width; ++ix) {
      const bool inside = ix >= 0 && iy >= 0 && ix < view.width() && iy < view.height();
      cells.push_back(inside ? view.cell(ix, iy) : Cell::kUnknown);
    }
  }
  const Point2 corner{
      view.corner().x + x0 * params_.resolution_m, view.corner().y + y0 * params_.resolution_m};
  return grid::OccupancyMap::fromCells(width, height, params_.resolution_m, corner, cells);
}

}  // namespace vestibule::mapping
