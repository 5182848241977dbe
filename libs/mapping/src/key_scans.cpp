#include "key_scans.hpp"

#include <cmath>
#include <optional>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/parallel.hpp"
#include "vestibule/mapping/drive_path.hpp"

namespace vestibule::mapping {
namespace {

// One sigma of the odometry, as measured on robots of several kinds, with room for worse ones.
constexpr double kTransPerTrans = 0.15;
constexpr double kTransPerRot_m = 0.10;
constexpr double kRotPerTrans_rad = 0.10;
constexpr double kRotPerRot = 0.20;
constexpr double kTransFloor_m = 0.02;
constexpr double kRotFloor_rad = 0.02;

}  // namespace

std::vector<KeyScan> keyScansAt(
    const std::vector<ScanNode>& nodes,
    const std::vector<std::size_t>& chosen,
    double max_range_m,
    std::size_t threads) {
  std::vector<std::optional<Contour>> contours(chosen.size());
  parallelFor(chosen.size(), threads, [&](std::size_t k) {
    contours[k].emplace(nodes[chosen[k]].scan, max_range_m);
  });
  std::vector<KeyScan> keys;
  keys.reserve(chosen.size());
  double path_m = 0.0;
  std::size_t at = 0;
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    for (; at < chosen[k]; ++at) {
      path_m += distance(nodes[at].T_odom_base, nodes[at + 1].T_odom_base);
    }
    keys.push_back({chosen[k], std::move(*contours[k]), path_m});
  }
  return keys;
}

std::vector<KeyScan> selectKeyScans(
    const std::vector<ScanNode>& nodes, const KeyScanParams& params, std::size_t threads) {
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (!chosen.empty() && i + 1 < nodes.size()) {
      const Pose2 moved = between(nodes[chosen.back()].T_odom_base, nodes[i].T_odom_base);
      if (translationNorm(moved) < params.distance_m && std::abs(moved.phi) < params.angle_rad) {
        continue;
      }
    }
    chosen.push_back(i);
  }
  return keyScansAt(nodes, chosen, params.max_range_m, threads);
}

RelativePrior odometryPrior(
    const std::vector<ScanNode>& nodes, const KeyScan& from, const KeyScan& to) {
  RelativePrior prior;
  prior.T_a_b = between(nodes[from.node].T_odom_base, nodes[to.node].T_odom_base);
  const double d = translationNorm(prior.T_a_b);
  const double a = std::abs(prior.T_a_b.phi);
  const double sigma_t = kTransFloor_m + kTransPerTrans * d + kTransPerRot_m * a;
  const double sigma_r = kRotFloor_rad + kRotPerTrans_rad * d + kRotPerRot * a;
  prior.information.diagonal() << 1.0 / (sigma_t * sigma_t), 1.0 / (sigma_t * sigma_t),
      1.0 / (sigma_r * sigma_r);
  return prior;
}

std::vector<Pose2> spreadCorrections(
    const std::vector<ScanNode>& nodes,
    const std::vector<KeyScan>& keys,
    const std::vector<Pose2>& T_map_key) {
  std::vector<std::size_t> used;
  used.reserve(keys.size());
  for (const KeyScan& key : keys) used.push_back(key.node);
  return spreadPath(nodes, used, T_map_key);
}

}  // namespace vestibule::mapping
