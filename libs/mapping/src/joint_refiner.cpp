#include "joint_refiner.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "vestibule/core/parallel.hpp"

namespace vestibule::mapping {
namespace {

constexpr std::size_t kNextOnTheWay = 3;  // key scans after each one that it is compared with
constexpr double kPassGap_m = 2.0;        // of travel between two visits of one place
constexpr double kOverlapGate_m = 0.15;
constexpr double kMinMatched = 0.3;
constexpr int kRepairEvery = 5;  // iterations between two choices of pairs
constexpr double kDamping = 1e-3;
constexpr double kConverged_m = 5e-4;
constexpr std::size_t kPlaceScans = 4;  // key scans that another scan is placed on
constexpr double kStill_m = 0.005;      // a robot that moves less stands still
constexpr double kStill_rad = 0.003;

}  // namespace

JointRefiner::JointRefiner(
    const std::vector<ScanNode>& nodes,
    const std::vector<KeyScan>& keys,
    const RefineParams& params,
    std::size_t threads)
    : nodes_(nodes), keys_(keys), params_(params), threads_(threads) {}

void JointRefiner::choosePairs(const std::vector<Pose2>& T_map_key) {
  const std::size_t n = keys_.size();
  std::vector<std::vector<std::size_t>> chosen(n);
  parallelFor(n, threads_, [&](std::size_t i) {
    struct Near {
      double d = 0.0;
      std::size_t k = 0;
    };
    std::vector<Near> near;
    for (std::size_t k = 0; k < i; ++k) {
      if (i - k <= kNextOnTheWay) continue;
      const double d = distance(T_map_key[i], T_map_key[k]);
      if (d < params_.pair_m) near.push_back({d, k});
    }
    std::sort(near.begin(), near.end(), [](const Near& a, const Near& b) {
      return std::pair(a.d, a.k) < std::pair(b.d, b.k);
    });
    // The nearest of each pass first: ten looks from one visit say little more than one.
    std::vector<std::size_t>& of_i = chosen[i];
    for (std::size_t k = i - std::min(i, kNextOnTheWay); k < i; ++k) of_i.push_back(k);
    const std::size_t own = of_i.size();
    for (const Near& candidate : near) {
      if (of_i.size() - own >= static_cast<std::size_t>(params_.pairs_per_scan)) break;
      bool fresh = true;
      for (const std::size_t k : of_i) {
        fresh = fresh && std::abs(keys_[k].path_m - keys_[candidate.k].path_m) > kPassGap_m;
      }
      if (!fresh) continue;
      const Overlap o = overlap(
          keys_[i].contour,
          keys_[candidate.k].contour,
          between(T_map_key[i], T_map_key[candidate.k]),
          kOverlapGate_m);
      if (o.agreement() >= params_.min_agreement && o.matchedShare() >= kMinMatched) {
        of_i.push_back(candidate.k);
      }
    }
  });
  pairs_.clear();
  neighbours_.assign(n, {});
  for (std::size_t i = 0; i < n; ++i) {
    for (const std::size_t k : chosen[i]) {
      pairs_.push_back({k, i});
      neighbours_[k].push_back(i);
      neighbours_[i].push_back(k);
    }
  }
}

std::vector<PairQuadratic> JointRefiner::linearise(
    const std::vector<Pose2>& T_map_key, double gate_m, double& rms_m) const {
  std::vector<PairQuadratic> all(pairs_.size() + keys_.size() - 1);
  struct Squares {
    double sum = 0.0;
    double weight = 0.0;
  };
  std::vector<Squares> squares_of(pairs_.size());
  const AlignmentParams alignment{params_.sigma_m, gate_m, params_.effective_points};
  parallelFor(pairs_.size(), threads_, [&](std::size_t i) {
    const Pair& pair = pairs_[i];
    const Quadratic q = pointToLine(
        keys_[pair.from].contour,
        keys_[pair.to].contour,
        between(T_map_key[pair.from], T_map_key[pair.to]),
        alignment);
    all[i] = {pair.from, pair.to, q.H, q.g};
    squares_of[i] = {q.weighted_squares, q.weight};
  });
  // The odometry speaks where the scans say nothing (long corridors).
  for (std::size_t k = 0; k + 1 < keys_.size(); ++k) {
    const RelativePrior prior = odometryPrior(nodes_, keys_[k], keys_[k + 1]);
    const PoseConstraint constraint{k, k + 1, prior.T_a_b, prior.information, false};
    const Eigen::Vector3d r = residual(constraint, T_map_key);
    // A slip must not pull: beyond three sigma its pull falls off.
    const double w = 1.0 / (1.0 + r.dot(prior.information * r) / 9.0);
    const Eigen::Matrix3d H = w * prior.information;
    all[pairs_.size() + k] = {k, k + 1, H, H * r};
  }
  double squares = 0.0;
  double weight = 0.0;
  for (const Squares& s : squares_of) {
    squares += s.sum;
    weight += s.weight;
  }
  rms_m = weight > 0.0 ? std::sqrt(squares / weight) : 0.0;
  return all;
}

std::vector<Pose2> JointRefiner::run(std::vector<Pose2> T_map_key, const ShareDone& progress) {
  if (keys_.size() < 2) return T_map_key;
  for (int i = 0; i < params_.iterations; ++i) {
    const bool late = i >= params_.iterations / 2;
    if (i % kRepairEvery == 0) choosePairs(T_map_key);
    double rms_m = 0.0;
    const double gate_m = late ? 0.5 * params_.gate_m : params_.gate_m;
    const auto quadratics = linearise(T_map_key, gate_m, rms_m);
    if (i == 0) rms_before_m_ = rms_m;
    rms_after_m_ = rms_m;
    const std::vector<Pose2> next = stepped(T_map_key, quadratics, kDamping);
    double largest_m = 0.0;
    for (std::size_t k = 0; k < next.size(); ++k) {
      largest_m = std::max(largest_m, distance(next[k], T_map_key[k]));
    }
    T_map_key = next;
    if (progress) progress(static_cast<double>(i + 1) / params_.iterations);
    if (late && largest_m < kConverged_m) break;
  }
  return T_map_key;
}

std::vector<Pose2> JointRefiner::placeAll(const std::vector<Pose2>& T_map_key) const {
  std::vector<Pose2> poses = spreadCorrections(nodes_, keys_, T_map_key);
  if (neighbours_.empty()) return poses;
  parallelFor(keys_.size(), threads_, [&](std::size_t k) {
    const ScanNode& key = nodes_[keys_[k].node];
    const std::size_t end = k + 1 < keys_.size() ? keys_[k + 1].node : nodes_.size();
    for (std::size_t i = keys_[k].node + 1; i < end; ++i) {
      const Pose2 moved = between(key.T_odom_base, nodes_[i].T_odom_base);
      // A robot that stands still is where the key scan was.
      if (translationNorm(moved) < kStill_m && std::abs(moved.phi) < kStill_rad) continue;
      poses[i] = place(nodes_[i].scan, poses[i], k, T_map_key);
    }
  });
  return poses;
}

Pose2 JointRefiner::place(
    const LaserScan& scan,
    const Pose2& T_map_guess,
    std::size_t k,
    const std::vector<Pose2>& T_map_key) const {
  const Contour contour(scan, params_.max_range_m);
  const std::size_t next = std::min(k + 1, keys_.size() - 1);
  std::set<std::size_t> around{k, next};
  for (const std::size_t other : neighbours_[k]) {
    if (around.size() >= kPlaceScans) break;
    around.insert(other);
  }
  Cluster map;
  for (const std::size_t other : around) {
    map.members.push_back({&keys_[other].contour, between(T_map_key[k], T_map_key[other])});
  }
  const Cluster one{{{&contour, Pose2{}}}};
  const Pose2 guess = between(T_map_key[k], T_map_guess);
  RelativePrior prior{guess, Eigen::Matrix3d::Zero()};
  prior.information.diagonal() << 1.0 / (0.05 * 0.05), 1.0 / (0.05 * 0.05), 1.0 / (0.05 * 0.05);
  const AlignmentParams alignment{params_.sigma_m, params_.gate_m, params_.effective_points};
  return compose(T_map_key[k], align(map, one, guess, alignment, prior).T_a_b);
}

}  // namespace vestibule::mapping
