#include "vestibule/mapping/track.hpp"

#include <algorithm>
#include <cmath>

#include "key_scans.hpp"
#include "relocate.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/parallel.hpp"

namespace vestibule::mapping {
namespace {

constexpr double kOverlapGate_m = 0.15;
constexpr double kSlip_m = 0.4;
constexpr double kSlip_rad = 0.15;

/// The last key scans, seen from the newest of them.
Cluster localCluster(
    const std::vector<KeyScan>& keys,
    const std::vector<Pose2>& poses,
    std::size_t end,
    int window) {
  Cluster cluster;
  const std::size_t first =
      end > static_cast<std::size_t>(window) ? end - static_cast<std::size_t>(window) : 0;
  for (std::size_t k = end; k-- > first;) {
    cluster.members.push_back({&keys[k].contour, between(poses[end - 1], poses[k])});
  }
  return cluster;
}

Cluster nearest(const Cluster& cluster, std::size_t n) {
  Cluster part = cluster;
  if (part.members.size() > n) part.members.resize(n);
  return part;
}

/// How well a place fits: what the older scans confirm, less what they contradict.
double fitOf(const Overlap& o) {
  return o.points > 0 ? static_cast<double>(o.matched - 2 * o.conflicting) / o.points : -1.0;
}

}  // namespace

TrackResult trackScans(
    std::vector<ScanNode> nodes,
    const TrackParams& params,
    int threads,
    const ShareDone& progress) {
  TrackResult result;
  if (nodes.empty()) return result;
  const std::vector<KeyScan> keys = selectKeyScans(nodes, {}, threadCount(threads));
  std::vector<Pose2> poses{nodes.front().T_map_base};
  const AlignmentParams alignment;
  for (std::size_t k = 1; k < keys.size(); ++k) {
    const Cluster target = localCluster(keys, poses, k, params.window);
    const Cluster query{{{&keys[k].contour, Pose2{}}}};
    const RelativePrior prior = odometryPrior(nodes, keys[k - 1], keys[k]);
    const Cluster fine = nearest(target, 5);
    Pose2 best = align(fine, query, prior.T_a_b, alignment, prior).T_a_b;
    Overlap found = overlap(target, query, best, kOverlapGate_m);
    if (found.agreement() < params.poor_agreement) {
      SearchParams search;
      search.half_m = params.search_m;
      search.half_rad = params.search_rad;
      search.min_score = 0.4;
      for (const Place& place : PlaceFinder(target).find(query, prior.T_a_b, search)) {
        const Pose2 candidate = align(fine, query, place.T_a_b, alignment).T_a_b;
        const Overlap fit = overlap(target, query, candidate, kOverlapGate_m);
        // A place far from what the odometry says must fit clearly better.
        if (fitOf(fit) > fitOf(found) + 0.05) {
          best = candidate;
          found = fit;
        }
      }
    }
    const Pose2 off = between(prior.T_a_b, best);
    if (translationNorm(off) > kSlip_m || std::abs(off.phi) > kSlip_rad) ++result.slips;
    poses.push_back(compose(poses.back(), best));
    if (progress && k % 16 == 0)
      progress(static_cast<double>(k) / static_cast<double>(keys.size()));
  }
  const std::vector<Pose2> all = spreadCorrections(nodes, keys, poses);
  for (std::size_t i = 0; i < nodes.size(); ++i) nodes[i].T_map_base = all[i];
  result.nodes = std::move(nodes);
  return result;
}

}  // namespace vestibule::mapping
