#pragma once

#include "cluster.hpp"

namespace vestibule::mapping {

struct SearchParams {
  double cell_m = 0.1;
  double half_m = 1.5;
  double half_rad = 0.45;
  double min_score = 0.5;
  int max_matches = 8;
};

/// Places of cluster b on cluster a around `guess`, by branch and bound: best first, with scores
/// in [0, 1].
struct Place {
  Pose2 T_a_b;
  double score = 0.0;
};
[[nodiscard]] std::vector<Place> findPlaces(
    const Cluster& a, const Cluster& b, const Pose2& guess, const SearchParams& params);

}  // namespace vestibule::mapping
