#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "vestibule/mapping/params.hpp"
#include "vestibule/mapping/patch_map.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::mapping {

/// Writes scans into maps. Per scan a cell counts once, however many beams meet it; a cell with an
/// end point is not seen free by the scan's other beams, and no beam clears its last half cell:
/// grazing beams would thin walls out. Holds scratch memory: one per thread.
class ScanIntegrator {
 public:
  /// \param free_range_m  free space farther from the laser is not written; walls are
  explicit ScanIntegrator(
      const FilterMapParams& params, double free_range_m = std::numeric_limits<double>::infinity());

  void integrate(PatchMap& map, const LaserScan& scan, const Pose2& T_map_base);

 private:
  /// True the first time a cell is marked; cells beyond the window count as marked.
  bool mark(int ix, int iy);
  void castFree(PatchMap::Writer& map, double x, double y, double dx, double dy, double length);

  double max_range_m_;
  double free_range_m_;
  int half_;                          // of the window of marks [cells]
  int words_;                         // per row
  std::vector<std::uint64_t> marks_;  // around the laser
  int x0_ = 0, y0_ = 0;               // lower left cell of the window
};

}  // namespace vestibule::mapping
