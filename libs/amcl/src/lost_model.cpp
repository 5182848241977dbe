#include "vestibule/amcl/lost_model.hpp"

#include <algorithm>
#include <cmath>

namespace vestibule::amcl {
namespace {

constexpr double kFloor = 0.01;  // shares of one beam in a hundred say no less than this

double logOdds(double share) { return std::log((share + kFloor) / (1.0 - share + kFloor)); }

}  // namespace

LostFeatures lostFeatures(const LostEvidence& e) {
  LostFeatures f;
  f << 1.0, logOdds(e.agreeing_share), logOdds(e.slow_agreeing_share), logOdds(e.sharp_share),
      std::log(e.off_map_share + 2.0 * kFloor), std::log1p(10.0 * e.spread_m),
      std::log(e.worst_blocked_share + kFloor), std::log(e.weakest_sigma_m + kFloor);
  return f;
}

double lostProbability(const LostFeatures& weights, const LostFeatures& features) {
  constexpr double kLimit = 30.0;
  return 1.0 / (1.0 + std::exp(-std::clamp(weights.dot(features), -kLimit, kLimit)));
}

double lostProbability(const LostEvidence& smoothed) {
  // `bench lost --fit --seed 11 --drives 50` in 16 buildings: the shipped worlds, five maps of
  // other people's and three made of recordings (docs/results.md).
  static const LostFeatures weights =
      (LostFeatures() << 7.386, -2.093, 0.410, 0.804, 0.665, 1.485, 1.438, 0.960).finished();
  return lostProbability(weights, lostFeatures(smoothed));
}

}  // namespace vestibule::amcl
