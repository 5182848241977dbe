#pragma once

#include <cstddef>
#include <memory>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::mapping {

struct KnownPosesParams {
  double resolution_m = 0.05;  ///< [m] cell size
  /// [m] beams are cut here: what lies farther is neither hit nor seen free.
  double max_range_m = 30.0;
  /// Hits per scan that saw a cell, from which it is occupied. Well below one half: where scans are
  /// a little off each other, the near side of a wall is seen through as often as it is hit, and a
  /// map without it lets the localizer stand too near to every wall it looks at.
  double occupied_ratio = 0.2;
  double margin_m = 1.0;  ///< [m] unknown rim kept around what was seen
};
void describe(ParamIo& io, KnownPosesParams& params);

/// Builds an occupancy map from scans whose robot poses are already right (the output of a SLAM
/// run): hits and passes counted per cell, as the particle filter's maps do. The grid grows to fit.
class KnownPosesMapper {
 public:
  explicit KnownPosesMapper(const KnownPosesParams& params);
  KnownPosesMapper(const KnownPosesMapper&) = delete;
  KnownPosesMapper& operator=(const KnownPosesMapper&) = delete;
  ~KnownPosesMapper();

  /// A "no echo" beam (at or beyond the scan's range_max_m) neither hits nor clears: a dark or
  /// slanted wall gives no echo either.
  void add(const Pose2& T_map_base, const LaserScan& scan);
  [[nodiscard]] std::size_t scanCount() const { return scan_count_; }

  /// The map so far, decided cell by cell into free, occupied and unknown; T_map_grid is identity
  /// up to the corner's place. \pre scanCount() > 0
  [[nodiscard]] grid::OccupancyMap build() const;

 private:
  struct Impl;
  KnownPosesParams params_;
  std::unique_ptr<Impl> impl_;
  std::size_t scan_count_ = 0;
};

}  // namespace vestibule::mapping
