#include "vestibule/mapping/finish.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "joint_refiner.hpp"
#include "loop_closer.hpp"
#include "vestibule/core/parallel.hpp"

namespace vestibule::mapping {
namespace {

// Shares of the work, for the progress report.
constexpr double kChainDone = 0.1;
constexpr double kClosingDone = 0.7;
constexpr double kRefiningDone = 0.9;
// What scans that were matched cannot tell about their own error: one sigma per step of the chain.
constexpr double kStepFloor_m = 0.003;
constexpr double kStepFloor_per_m = 0.02;
constexpr double kStepFloor_rad = 0.002;
constexpr double kStepFloor_rad_per_m = 0.008;

// What wheels that slip can do within a second or two, and how it shows.
constexpr double kSlip_m = 1.0;
constexpr double kSlip_rad = 0.35;
constexpr double kSlipChi2 = 9.0;
constexpr double kBrokenAgreement = 0.6;
constexpr double kAsGood = 0.05;  // of the agreement of two places between which it does not decide
constexpr double kOverlapGate_m = 0.15;

ShareDone between(const ShareDone& progress, double from, double to) {
  if (!progress) return {};
  return [progress, from, to](double share) { progress(from + share * (to - from)); };
}

Eigen::Matrix3d covarianceOf(double sigma_m, double sigma_rad) {
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
  cov.diagonal() << sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad;
  return cov;
}

double chi2Of(const Pose2& T, const RelativePrior& prior) {
  const Eigen::Vector3d off(
      T.x - prior.T_a_b.x, T.y - prior.T_a_b.y, angleDiff(T.phi, prior.T_a_b.phi));
  return off.dot(prior.information * off);
}

/// Key scan k + 1 seen from k: as the estimate has it, with what scans and odometry say about its
/// certainty.
PoseConstraint chainLink(
    const std::vector<ScanNode>& nodes,
    const std::vector<KeyScan>& keys,
    std::size_t k,
    const AlignmentParams& alignment) {
  Pose2 T = vestibule::between(nodes[keys[k].node].T_map_base, nodes[keys[k + 1].node].T_map_base);
  const Contour& from = keys[k].contour;
  const Contour& to = keys[k + 1].contour;
  RelativePrior prior = odometryPrior(nodes, keys[k], keys[k + 1]);
  Overlap seen = overlap(from, to, T, kOverlapGate_m);
  if (chi2Of(T, prior) > kSlipChi2) {
    // The estimate jumped: wheels that slipped, or a path that has drifted and found back into the
    // map. Where these two scans allow what the odometry says, as along a corridor, it was not here
    // that the path went wrong.
    const Pose2 start{prior.T_a_b.x, prior.T_a_b.y, T.phi};
    const Cluster a{{{&from, Pose2{}}}};
    const Cluster b{{{&to, Pose2{}}}};
    const Pose2 other = align(a, b, start, alignment, prior).T_a_b;
    const Overlap there = overlap(from, to, other, kOverlapGate_m);
    if (there.agreement() > seen.agreement() - kAsGood) {
      T = other;
      seen = there;
    }
  }
  if (chi2Of(T, prior) > kSlipChi2) prior.information = covarianceOf(kSlip_m, kSlip_rad).inverse();
  const Quadratic q = pointToLine(from, to, T, alignment);
  const double d = translationNorm(T);
  // Scans that contradict each other, or say nothing about a slip: the link may be wrong.
  const bool broken = seen.agreement() < kBrokenAgreement;
  const Eigen::Matrix3d floor =
      broken ? covarianceOf(kSlip_m, kSlip_rad)
             : covarianceOf(
                   kStepFloor_m + kStepFloor_per_m * d, kStepFloor_rad + kStepFloor_rad_per_m * d);
  const Eigen::Matrix3d cov = (q.H + prior.information).inverse() + floor;
  return {k, k + 1, T, cov.inverse(), false};
}

std::vector<PoseConstraint> chainOf(
    const std::vector<ScanNode>& nodes,
    const std::vector<KeyScan>& keys,
    const RefineParams& params,
    std::size_t threads) {
  std::vector<PoseConstraint> chain(keys.empty() ? 0 : keys.size() - 1);
  const AlignmentParams alignment{params.sigma_m, params.gate_m, params.effective_points};
  parallelFor(chain.size(), threads, [&](std::size_t k) {
    chain[k] = chainLink(nodes, keys, k, alignment);
  });
  return chain;
}

}  // namespace

void describe(ParamIo& io, ClosureParams& p) {
  io.optional("submap_m", p.submap_m, Bounds{0.5, 100.0});
  io.optional("reach_m", p.reach_m, positive());
  io.optional("min_score", p.min_score, inside(0.0, 1.0));
  io.optional("min_agreement", p.min_agreement, within(0.0, 1.0));
  io.optional("min_matched", p.min_matched, within(0.0, 1.0));
  io.optional("max_window_m", p.max_window_m, positive());
  io.optionalDegrees("max_window_deg", p.max_window_rad, within(0.0, 180.0));
  io.optional("gate_probability", p.gate_probability, inside(0.0, 1.0));
  io.optional("partner_m", p.partner_m, positive());
  io.optional("rounds", p.rounds, within(0, 100));
}

void describe(ParamIo& io, RefineParams& p) {
  io.optional("max_range_m", p.max_range_m, positive());
  io.optional("sigma_m", p.sigma_m, positive());
  io.optional("gate_m", p.gate_m, positive());
  io.optional("effective_points", p.effective_points, positive());
  io.optional("pair_m", p.pair_m, positive());
  io.optional("pairs_per_scan", p.pairs_per_scan, within(0, 1000));
  io.optional("min_agreement", p.min_agreement, within(0.0, 1.0));
  io.optional("iterations", p.iterations, within(0, 1000));
}

void describe(ParamIo& io, SmoothParams& p) {
  io.optional("iterations", p.iterations, within(0, 1000));
  io.optional("pairs_per_scan", p.pairs_per_scan, within(0, 1000));
}

void describe(ParamIo& io, FinishParams& p) {
  io.optional("threads", p.threads, within(0, 1024));
  io.section("closures", p.closures);
  io.section("refine", p.refine);
}

std::string_view toString(ClosureVerdict verdict) {
  switch (verdict) {
    case ClosureVerdict::kAccepted:
      return "accepted";
    case ClosureVerdict::kConflict:
      return "scans contradict each other";
    case ClosureVerdict::kAmbiguous:
      return "another place fits as well";
    case ClosureVerdict::kUnlikely:
      return "too far from the way there";
    case ClosureVerdict::kAlone:
      return "not confirmed by a second one";
    case ClosureVerdict::kOutvoted:
      return "outvoted";
  }
  return "?";
}

std::size_t FinishResult::count(ClosureVerdict verdict) const {
  return static_cast<std::size_t>(
      std::count_if(closures.begin(), closures.end(), [verdict](const Closure& c) {
        return c.verdict == verdict;
      }));
}

std::vector<PoseConstraint> chainOf(
    const std::vector<ScanNode>& nodes,
    const std::vector<std::size_t>& used,
    const FinishParams& params) {
  const std::size_t threads = threadCount(params.threads);
  return chainOf(
      nodes, keyScansAt(nodes, used, params.refine.max_range_m, threads), params.refine, threads);
}

void smoothDrive(
    std::vector<ScanNode>& nodes,
    const std::vector<std::size_t>& used,
    const SmoothParams& smooth,
    const FinishParams& params,
    const ShareDone& progress) {
  if (smooth.iterations == 0) return;
  RefineParams refine = params.refine;
  refine.iterations = smooth.iterations;
  refine.pairs_per_scan = smooth.pairs_per_scan;
  const std::size_t threads = threadCount(params.threads);
  const std::vector<KeyScan> keys = keyScansAt(nodes, used, refine.max_range_m, threads);
  std::vector<Pose2> poses;
  for (const KeyScan& key : keys) poses.push_back(nodes[key.node].T_map_base);
  JointRefiner refiner(nodes, keys, refine, threads);
  poses = refiner.run(std::move(poses), progress);
  const std::vector<Pose2> all = refiner.placeAll(poses);
  for (std::size_t i = 0; i < nodes.size(); ++i) nodes[i].T_map_base = all[i];
}

FinishResult finishMap(
    std::vector<ScanNode> nodes, const FinishParams& params, const ShareDone& progress) {
  FinishResult result;
  if (nodes.empty()) return result;
  const std::size_t threads = threadCount(params.threads);
  KeyScanParams key_params;
  key_params.max_range_m = params.refine.max_range_m;
  const std::vector<KeyScan> keys = selectKeyScans(nodes, key_params, threads);
  std::vector<Pose2> poses;
  for (const KeyScan& key : keys) {
    result.keys.push_back(key.node);
    poses.push_back(nodes[key.node].T_map_base);
  }
  const std::vector<PoseConstraint> chain = chainOf(nodes, keys, params.refine, threads);
  if (progress) progress(kChainDone);

  LoopCloser closer(keys, chain, params);
  poses = closer.run(std::move(poses), between(progress, kChainDone, kClosingDone));
  result.closures = closer.closures();
  for (Closure& c : result.closures) {
    c.from = keys[c.from].node;
    c.to = keys[c.to].node;
  }
  result.graph = closer.graph();
  result.submaps = closer.submapCount();

  JointRefiner refiner(nodes, keys, params.refine, threads);
  poses = refiner.run(std::move(poses), between(progress, kClosingDone, kRefiningDone));
  result.pairs = refiner.pairCount();
  result.surface_rms_before_m = refiner.rmsBefore();
  result.surface_rms_after_m = refiner.rmsAfter();

  const std::vector<Pose2> all = refiner.placeAll(poses);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    result.largest_correction_m =
        std::max(result.largest_correction_m, distance(nodes[i].T_map_base, all[i]));
    nodes[i].T_map_base = all[i];
  }
  for (Closure& c : result.closures) {
    c.T_map_from = all[c.from];
    c.T_map_to = all[c.to];
  }
  result.nodes = std::move(nodes);
  if (progress) progress(1.0);
  return result;
}

}  // namespace vestibule::mapping
