#include "vestibule/mapping/drive_path.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "scan_integrator.hpp"
#include "vestibule/mapping/scan_matcher.hpp"

namespace vestibule::mapping {
namespace {

// What odometry errs by grows with the way and the turn; a robot that stands errs a little, too.
constexpr double kMetresPerRadian = 0.3;
constexpr double kMetresPerScan = 1e-4;

constexpr double kFoundShare = 0.7;  // of a scan's points on walls, to believe a place

double effort(const Pose2& T_a_b) {
  return translationNorm(T_a_b) + kMetresPerRadian * std::abs(T_a_b.phi) + kMetresPerScan;
}

}  // namespace

std::vector<Pose2> spreadPath(
    const std::vector<ScanNode>& nodes,
    const std::vector<std::size_t>& used,
    const std::vector<Pose2>& path) {
  assert(used.size() == path.size());
  std::vector<Pose2> poses;
  poses.reserve(nodes.size());
  for (const ScanNode& node : nodes) poses.push_back(node.T_map_base);
  for (std::size_t k = 0; k < used.size(); ++k) {
    const std::size_t first = used[k];
    const bool is_last = k + 1 == used.size();
    const std::size_t end = is_last ? nodes.size() : used[k + 1];
    std::vector<double> way(1, 0.0);
    for (std::size_t i = first + 1; i <= end && i < nodes.size(); ++i) {
      way.push_back(way.back() + effort(between(nodes[i - 1].T_odom_base, nodes[i].T_odom_base)));
    }
    Pose2 correction;
    if (!is_last) {
      correction = between(
          between(nodes[first].T_odom_base, nodes[end].T_odom_base), between(path[k], path[k + 1]));
    }
    for (std::size_t i = first; i < end; ++i) {
      const Pose2 T = compose(path[k], between(nodes[first].T_odom_base, nodes[i].T_odom_base));
      const double share = is_last || way.back() <= 0.0 ? 0.0 : way[i - first] / way.back();
      poses[i] = compose(T, interpolate(Pose2{}, correction, share));
    }
  }
  return poses;
}

PatchMap mapOf(const std::vector<PosedScan>& scans, const FilterMapParams& params) {
  PatchMap map(params.resolution_m, params.occupied_ratio, params.max_count);
  ScanIntegrator integrator(params);
  for (const PosedScan& s : scans) integrator.integrate(map, *s.scan, s.T_map_base);
  return map;
}

PatchMap mapOf(const std::vector<ScanNode>& nodes, const FilterMapParams& params) {
  std::vector<PosedScan> scans;
  scans.reserve(nodes.size());
  for (const ScanNode& node : nodes) scans.push_back({&node.scan, node.T_map_base});
  return mapOf(scans, params);
}

std::optional<Pose2> findInMap(
    const PatchMap& map, const LaserScan& scan, const MatcherParams& params) {
  const PatchMap::Extent e = map.extent();
  const double side = Patch::kSide * map.resolution();
  const Pose2 centre{(e.x0 + 0.5 * e.columns) * side, (e.y0 + 0.5 * e.rows) * side, 0.0};
  const PosePrior anywhere{centre, Eigen::Matrix3d::Identity() * 1e-9};
  const ScanPoints points = matchPoints(scan, params);
  ScanMatcher matcher(params);
  const Pose2 found =
      matcher.search(map, points, anywhere, 0.5 * side * std::max(e.columns, e.rows), kPi);
  const Pose2 T = matcher.refine(map, points, found, {found, anywhere.information}).T_map_base;
  if (matcher.fit(map, points, T).matched_share < kFoundShare) return std::nullopt;
  return T;
}

}  // namespace vestibule::mapping
