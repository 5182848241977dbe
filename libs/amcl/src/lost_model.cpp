#include "vestibule/amcl/lost_model.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::amcl {

double lostProbability(const LostEvidence& e) {
  const double score = 4.0 - 14.0 * e.inlier_share + 14.0 * e.blocked_share +
                       2.0 * e.off_map_share + 2.0 * std::log1p(e.spread_m);
  return 1.0 / (1.0 + std::exp(-std::clamp(score, -30.0, 30.0)));
}

}  // namespace vestibule::amcl
