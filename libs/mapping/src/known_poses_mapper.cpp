#include "vestibule/mapping/known_poses_mapper.hpp"

#include <cassert>

#include "scan_integrator.hpp"
#include "vestibule/mapping/map_quality.hpp"
#include "vestibule/mapping/patch_map.hpp"

namespace vestibule::mapping {
namespace {

FilterMapParams filterMap(const KnownPosesParams& params) {
  FilterMapParams map;
  map.resolution_m = params.resolution_m;
  map.max_range_m = params.max_range_m;
  map.occupied_ratio = params.occupied_ratio;
  map.max_count = 60000;  // nothing needs to be forgotten
  return map;
}

}  // namespace

void describe(ParamIo& io, KnownPosesParams& params) {
  io.optional("resolution_m", params.resolution_m, Bounds{0.005, 1.0});
  io.optional("max_range_m", params.max_range_m, positive());
  io.optional("occupied_ratio", params.occupied_ratio, inside(0.0, 1.0));
  io.optional("margin_m", params.margin_m, nonNegative());
}

struct KnownPosesMapper::Impl {
  explicit Impl(const FilterMapParams& params)
      : map(params.resolution_m, params.occupied_ratio, params.max_count), integrator(params) {}

  PatchMap map;
  ScanIntegrator integrator;
};

KnownPosesMapper::KnownPosesMapper(const KnownPosesParams& params)
    : params_(params), impl_(std::make_unique<Impl>(filterMap(params))) {}

KnownPosesMapper::~KnownPosesMapper() = default;

void KnownPosesMapper::add(const Pose2& T_map_base, const LaserScan& scan) {
  ++scan_count_;
  impl_->integrator.integrate(impl_->map, scan, T_map_base);
}

grid::OccupancyMap KnownPosesMapper::build() const {
  assert(scan_count_ > 0);
  return toOccupancyMap(impl_->map, params_.margin_m);
}

}  // namespace vestibule::mapping
