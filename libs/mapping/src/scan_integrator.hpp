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
  /// A bit per cell of a window around the laser, patch by patch as in the map.
  class Marks {
   public:
    explicit Marks(int patches) : patches_(patches), rows_(words(patches), 0) {}
    void set(int ix, int iy) { word(ix, iy) |= bit(ix); }
    [[nodiscard]] bool test(int ix, int iy) { return (word(ix, iy) & bit(ix)) != 0; }
    /// The rows of a patch. Patches and cells count from the window's lower left corner.
    [[nodiscard]] std::uint32_t* patch(int px, int py) {
      return &word(px << Patch::kBits, py << Patch::kBits);
    }

   private:
    static std::size_t words(int patches) {
      return static_cast<std::size_t>(patches * patches) * Patch::kSide;
    }
    [[nodiscard]] std::uint32_t& word(int ix, int iy) {
      const int patch = (iy >> Patch::kBits) * patches_ + (ix >> Patch::kBits);
      return rows_[static_cast<std::size_t>((patch << Patch::kBits) + (iy & (Patch::kSide - 1)))];
    }
    static std::uint32_t bit(int ix) {
      return 1U << static_cast<unsigned>(ix & (Patch::kSide - 1));
    }

    int patches_;  // per side
    std::vector<std::uint32_t> rows_;
  };
  struct Beam {
    double dx = 0.0;
    double dy = 0.0;
    double length = 0.0;  // [cells] 0 = no echo
  };

  /// \param reach [cells] beams are cut here
  void castBeams(double x, double y, double step_rad, double reach);
  template <bool kSteep>
  void castFree(double x, double y, double dx, double dy, double length);

  double max_range_m_;
  double free_range_m_;
  int half_;  // of the window [cells]
  Marks ends_;
  Marks free_;
  std::vector<Beam> beams_;  // of the present scan, all of them
};

}  // namespace vestibule::mapping
