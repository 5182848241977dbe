#include "vestibule/amcl/lost_model.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::amcl {

double lostProbability(const LostEvidence& e) {
  // Logistic regression on 20 drives each in the scenarios office_nominal and farm_lane, 5507
  // samples
  // (`bench lost`, seeds 301 and 302).
  const double score = 19.72 - 3.05 * e.inlier_share + 1.58 * std::log(e.blocked_share + 0.01) +
                       3.56 * std::log(e.slow_blocked_share + 0.01) + 2.89 * e.off_map_share +
                       1.63 * std::log1p(10.0 * e.spread_m) + 0.20 * std::log1p(e.odometry_chi2);
  return 1.0 / (1.0 + std::exp(-std::clamp(score, -30.0, 30.0)));
}

}  // namespace vestibule::amcl
