#pragma once

#include <optional>
#include <vector>

#include "cluster.hpp"
#include "vestibule/grid/score_field.hpp"

namespace vestibule::mapping {

struct SearchParams {
  double half_m = 1.5;
  double half_rad = 0.45;
  double min_score = 0.5;
  int max_matches = 8;
};

struct Place {
  Pose2 T_a_b;
  double score = 0.0;  ///< in [0, 1]
};

/// Finds places of other clusters on cluster a, by branch and bound. What that needs is made when
/// it is first asked. Not thread-safe.
class PlaceFinder {
 public:
  explicit PlaceFinder(const Cluster& a) : a_(a) {}  ///< \param a outlives the finder

  /// Places of b around `guess`, best first.
  [[nodiscard]] std::vector<Place> find(
      const Cluster& b, const Pose2& guess, const SearchParams& params);

 private:
  const Cluster& a_;
  std::optional<grid::ScoreField> field_;
};

}  // namespace vestibule::mapping
