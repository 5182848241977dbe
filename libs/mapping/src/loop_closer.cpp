#include "loop_closer.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <queue>
#include <set>

#include "vestibule/core/parallel.hpp"
#include "vestibule/metrics/statistics.hpp"

namespace vestibule::mapping {
namespace {

constexpr std::size_t kTargetScans = 5;
constexpr std::size_t kQueryScans = 3;
constexpr double kOverlapGate_m = 0.15;
constexpr double kWindowSigmas = 3.0;
constexpr double kLeastWindow_m = 0.6;
constexpr double kLeastWindow_rad = 0.15;
constexpr double kRivalShare = 0.9;    // a second place that fits this share as well ...
constexpr double kRivalApart_m = 0.8;  // ... this far away makes the first ambiguous
constexpr double kRivalApart_rad = 0.5;
constexpr double kYawLever_m = 10.0;  // weighs yaw against position where one number is needed
constexpr double kBelieved = 0.5;     // weight from which a closure counts as accepted
// Two closures that fit as well as this confirm each other from farther away.
constexpr double kStrongAgreement = 0.9;
constexpr double kStrongMatched = 0.4;
constexpr double kFarPartner_m = 100.0;
// What scans that were matched cannot tell about their own error: one sigma.
constexpr double kClosureFloor_m = 0.03;
constexpr double kClosureFloor_rad = 0.006;
constexpr double kStill_m = 0.01;  // a round that changes no pose by more was the last

Eigen::Vector3d difference(const Pose2& a, const Pose2& b) {
  return {a.x - b.x, a.y - b.y, angleDiff(a.phi, b.phi)};
}

PoseWithCovariance chained(const PoseWithCovariance& T_a_b, const PoseWithCovariance& T_b_c) {
  PoseWithCovariance T_a_c = compose(T_a_b, T_b_c.mean);
  T_a_c.cov += compose(T_a_b.mean, T_b_c).cov;
  return T_a_c;
}

PoseWithCovariance inverted(const PoseWithCovariance& T_a_b) {
  PoseWithCovariance T_b_a;
  T_b_a.mean = inverse(T_a_b.mean);
  const double c = std::cos(T_a_b.mean.phi);
  const double s = std::sin(T_a_b.mean.phi);
  Eigen::Matrix3d J;
  J << -c, -s, T_b_a.mean.y, s, -c, -T_b_a.mean.x, 0.0, 0.0, -1.0;
  T_b_a.cov = J * T_a_b.cov * J.transpose();
  return T_b_a;
}

/// The constraint from keys a to b as a step of a way that starts at `from`.
PoseWithCovariance stepOf(const PoseConstraint& c, std::size_t from) {
  Eigen::Matrix3d information = c.information;
  information.diagonal().array() += 1e-2;  // directions without information: 10 m, 10 rad
  const PoseWithCovariance forward{c.T_from_to, information.inverse()};
  return c.from == from ? forward : inverted(forward);
}

double fitOf(const Overlap& o) {
  return o.points > 0 ? static_cast<double>(o.matched - 2 * o.conflicting) / o.points : -1.0;
}

/// (H^-1 + floor)^-1, also for a singular H.
Eigen::Matrix3d withFloor(const Eigen::Matrix3d& H) {
  Eigen::Matrix3d floor = Eigen::Matrix3d::Zero();
  floor.diagonal() << kClosureFloor_m * kClosureFloor_m, kClosureFloor_m * kClosureFloor_m,
      kClosureFloor_rad * kClosureFloor_rad;
  const Eigen::Matrix3d I = H * (Eigen::Matrix3d::Identity() + floor * H).inverse();
  return 0.5 * (I + I.transpose());
}

}  // namespace

LoopCloser::LoopCloser(
    const std::vector<KeyScan>& keys,
    const std::vector<PoseConstraint>& chain,
    const FinishParams& params)
    : keys_(keys),
      chain_(chain),
      params_(params),
      gate_chi2_(metrics::chiSquareQuantile(params.closures.gate_probability, 3)),
      submaps_(cutSubmaps(keys, params.closures.submap_m)) {}

std::vector<PoseWithCovariance> LoopCloser::ways(
    std::size_t from_key, const std::vector<std::vector<std::size_t>>& edges_of_key) const {
  std::vector<PoseWithCovariance> way(keys_.size());
  std::vector<double> length(keys_.size(), 1e300);
  using Entry = std::pair<double, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  length[from_key] = 0.0;
  open.push({0.0, from_key});
  while (!open.empty()) {
    const auto [d, k] = open.top();
    open.pop();
    if (d > length[k]) continue;
    for (const std::size_t e : edges_of_key[k]) {
      const PoseConstraint& c =
          e < chain_.size() ? chain_[e] : accepted_[e - chain_.size()].constraint;
      const std::size_t other = c.from == k ? c.to : c.from;
      const PoseWithCovariance step = stepOf(c, k);
      const double next =
          d + step.cov(0, 0) + step.cov(1, 1) + kYawLever_m * kYawLever_m * step.cov(2, 2);
      if (next >= length[other]) continue;
      length[other] = next;
      way[other] = chained(way[k], step);
      open.push({next, other});
    }
  }
  return way;
}

std::vector<LoopCloser::Candidate> LoopCloser::candidates(
    const std::vector<Pose2>& T_map_key) const {
  std::vector<std::vector<std::size_t>> edges_of_key(keys_.size());
  const auto enter = [&](std::size_t e, const PoseConstraint& c) {
    edges_of_key[c.from].push_back(e);
    edges_of_key[c.to].push_back(e);
  };
  for (std::size_t e = 0; e < chain_.size(); ++e) enter(e, chain_[e]);
  std::set<std::pair<std::size_t, std::size_t>> closed;
  for (std::size_t e = 0; e < accepted_.size(); ++e) {
    enter(chain_.size() + e, accepted_[e].constraint);
    closed.insert({accepted_[e].target, accepted_[e].query});
  }
  std::vector<std::vector<Candidate>> of_target(submaps_.size());
  parallelFor(submaps_.size(), threadCount(params_.threads), [&](std::size_t t) {
    if (t + 2 >= submaps_.size()) return;
    const std::size_t anchor = submaps_[t].anchor;
    const auto way = ways(anchor, edges_of_key);
    for (std::size_t q = t + 2; q < submaps_.size(); ++q) {
      if (closed.count({t, q}) > 0) continue;
      const std::size_t k = submaps_[q].anchor;
      const PoseWithCovariance predicted{between(T_map_key[anchor], T_map_key[k]), way[k].cov};
      const double sigma = std::sqrt(std::max(predicted.cov(0, 0), predicted.cov(1, 1)));
      const double window = std::min(kWindowSigmas * sigma, params_.closures.max_window_m);
      if (translationNorm(predicted.mean) > params_.closures.reach_m + window) continue;
      of_target[t].push_back({t, q, predicted});
    }
  });
  std::vector<Candidate> all;
  for (auto& some : of_target) all.insert(all.end(), some.begin(), some.end());
  return all;
}

std::vector<std::vector<LoopCloser::Found>> LoopCloser::compareAll(
    const std::vector<Candidate>& open,
    const std::vector<Pose2>& T_map_key,
    const ShareDone& progress) const {
  std::vector<std::vector<Found>> found(open.size());
  std::vector<std::size_t> first;  // of the candidates of each target
  for (std::size_t i = 0; i < open.size(); ++i) {
    if (i == 0 || open[i].target != open[i - 1].target) first.push_back(i);
  }
  first.push_back(open.size());
  constexpr std::size_t kBatch = 32;  // targets between two reports
  const std::size_t targets = first.size() - 1;
  for (std::size_t begin = 0; begin < targets; begin += kBatch) {
    const std::size_t n = std::min(kBatch, targets - begin);
    parallelFor(n, threadCount(params_.threads), [&](std::size_t k) {
      const std::size_t from = first[begin + k];
      const Cluster a = clusterOf(submaps_[open[from].target], keys_, T_map_key, kTargetScans);
      PlaceFinder places(a);
      for (std::size_t i = from; i < first[begin + k + 1]; ++i) {
        found[i] = compare(open[i], a, places, T_map_key);
      }
    });
    if (progress)
      progress(static_cast<double>(first[begin + n]) / static_cast<double>(open.size()));
  }
  return found;
}

std::vector<LoopCloser::Found> LoopCloser::compare(
    const Candidate& candidate,
    const Cluster& a,
    PlaceFinder& places,
    const std::vector<Pose2>& T_map_key) const {
  const ClosureParams& p = params_.closures;
  const Submap& target = submaps_[candidate.target];
  const Submap& query = submaps_[candidate.query];
  const Cluster b = clusterOf(query, keys_, T_map_key, kQueryScans);
  AlignmentParams alignment{params_.refine.sigma_m, 0.4, params_.refine.effective_points};
  const auto good = [&](const Overlap& o) {
    return o.agreement() >= p.min_agreement && o.matchedShare() >= p.min_matched;
  };
  struct Fit {
    Alignment alignment;
    Overlap overlap;
  };
  const auto fitAt = [&](const Pose2& start) {
    Fit fit;
    fit.alignment = align(a, b, start, alignment);
    fit.overlap = overlap(a, b, fit.alignment.T_a_b, kOverlapGate_m);
    return fit;
  };
  Fit best = fitAt(candidate.predicted.mean);
  bool ambiguous = false;
  if (!good(best.overlap)) {
    const double sigma_m =
        std::sqrt(std::max(candidate.predicted.cov(0, 0), candidate.predicted.cov(1, 1)));
    const double sigma_rad = std::sqrt(candidate.predicted.cov(2, 2));
    SearchParams search;
    search.half_m = std::clamp(kWindowSigmas * sigma_m, kLeastWindow_m, p.max_window_m);
    search.half_rad = std::clamp(kWindowSigmas * sigma_rad, kLeastWindow_rad, p.max_window_rad);
    search.min_score = p.min_score;
    search.max_matches = 4;
    std::vector<Fit> fits;
    for (const Place& place : places.find(b, candidate.predicted.mean, search)) {
      fits.push_back(fitAt(place.T_a_b));
    }
    for (const Fit& fit : fits) {
      if (fitOf(fit.overlap) > fitOf(best.overlap)) best = fit;
    }
    for (const Fit& fit : fits) {
      const Pose2 apart = between(best.alignment.T_a_b, fit.alignment.T_a_b);
      const bool elsewhere =
          translationNorm(apart) > kRivalApart_m || std::abs(apart.phi) > kRivalApart_rad;
      ambiguous = ambiguous || (elsewhere && good(fit.overlap) &&
                                fitOf(fit.overlap) > kRivalShare * fitOf(best.overlap));
    }
  }
  // Places that do not even look alike are no news.
  if (best.overlap.matchedShare() < p.min_matched) return {};
  Found found;
  found.target = candidate.target;
  found.query = candidate.query;
  found.constraint = {
      target.anchor,
      query.anchor,
      best.alignment.T_a_b,
      withFloor(best.alignment.information),
      true};
  Closure& closure = found.closure;
  closure.from = target.anchor;
  closure.to = query.anchor;
  closure.T_from_to = best.alignment.T_a_b;
  closure.agreement = best.overlap.agreement();
  closure.matched = best.overlap.matchedShare();
  const Eigen::Vector3d off = difference(best.alignment.T_a_b, candidate.predicted.mean);
  closure.chi2 = off.dot(candidate.predicted.cov.ldlt().solve(off));
  if (!good(best.overlap)) {
    closure.verdict = ClosureVerdict::kConflict;
  } else if (ambiguous) {
    closure.verdict = ClosureVerdict::kAmbiguous;
  } else if (!(closure.chi2 <= gate_chi2_)) {
    closure.verdict = ClosureVerdict::kUnlikely;
  }
  return {found};
}

void LoopCloser::vote(std::vector<Found>& found, const std::vector<Pose2>& T_map_key) const {
  // T_first_last along the drive.
  const auto along = [&](std::size_t first, std::size_t last) {
    PoseWithCovariance way;
    const bool forward = first < last;
    const std::size_t low = std::min(first, last);
    const std::size_t high = std::max(first, last);
    for (std::size_t k = low; k < high; ++k) way = chained(way, stepOf(chain_[k], k));
    way.mean = between(T_map_key[low], T_map_key[high]);
    return forward ? way : inverted(way);
  };
  const auto travel = [&](std::size_t a, std::size_t b) {
    return std::abs(keys_[a].path_m - keys_[b].path_m);
  };
  const auto agree = [&](const Found& f, const Found& g, double within_m) {
    if (f.target == g.target && f.query == g.query) return false;
    const std::size_t tf = f.closure.from, tg = g.closure.from;
    const std::size_t qf = f.closure.to, qg = g.closure.to;
    if (travel(tf, tg) > within_m || travel(qf, qg) > within_m) return false;
    // tf -> qf -> qg against tf -> tg -> qg.
    const PoseWithCovariance one = chained(stepOf(f.constraint, tf), along(qf, qg));
    const PoseWithCovariance other = chained(along(tf, tg), stepOf(g.constraint, tg));
    const Eigen::Vector3d off = difference(one.mean, other.mean);
    const Eigen::Matrix3d P = one.cov + other.cov;
    return off.dot(P.ldlt().solve(off)) <= gate_chi2_;
  };
  const auto strong = [](const Found& f) {
    return f.closure.agreement >= kStrongAgreement && f.closure.matched >= kStrongMatched;
  };
  std::vector<char> confirmed(found.size(), 0);
  parallelFor(found.size(), threadCount(params_.threads), [&](std::size_t i) {
    const auto anyAgrees = [&](double within_m, const auto& counts) {
      const auto says = [&](const Found& other) {
        return other.closure.verdict == ClosureVerdict::kAccepted && counts(other) &&
               agree(found[i], other, within_m);
      };
      return std::any_of(found.begin(), found.end(), says) ||
             std::any_of(accepted_.begin(), accepted_.end(), says);
    };
    if (found[i].closure.verdict != ClosureVerdict::kAccepted) return;
    const bool near = anyAgrees(params_.closures.partner_m, [](const Found&) { return true; });
    confirmed[i] = near || (strong(found[i]) && anyAgrees(kFarPartner_m, strong)) ? 1 : 0;
  });
  for (std::size_t i = 0; i < found.size(); ++i) {
    Closure& closure = found[i].closure;
    if (closure.verdict == ClosureVerdict::kAccepted && confirmed[i] == 0) {
      closure.verdict = ClosureVerdict::kAlone;
    }
  }
}

std::vector<PoseConstraint> LoopCloser::graph() const {
  std::vector<PoseConstraint> constraints = chain_;
  for (const Found& f : accepted_) constraints.push_back(f.constraint);
  return constraints;
}

std::vector<Pose2> LoopCloser::run(std::vector<Pose2> T_map_key, const ShareDone& progress) {
  for (int round = 0; round < params_.closures.rounds; ++round) {
    const std::vector<Candidate> open = candidates(T_map_key);
    std::vector<Found> found;
    for (auto& some : compareAll(open, T_map_key, [&](double share) {
           if (progress) progress((round + share) / params_.closures.rounds);
         })) {
      found.insert(found.end(), some.begin(), some.end());
    }
    vote(found, T_map_key);
    closures_.clear();
    bool any_new = false;
    for (const Found& f : found) {
      if (f.closure.verdict == ClosureVerdict::kAccepted) {
        accepted_.push_back(f);
        any_new = true;
      } else {
        closures_.push_back(f.closure);
      }
    }
    if (!any_new) break;
    PoseGraphParams graph_params;
    graph_params.inlier_chi2 = gate_chi2_;
    const PoseGraphResult fitted = optimisePoseGraph(T_map_key, graph(), graph_params);
    std::vector<Found> believed;
    for (std::size_t i = 0; i < accepted_.size(); ++i) {
      if (fitted.weights[chain_.size() + i] >= kBelieved) {
        believed.push_back(accepted_[i]);
      } else {
        closures_.push_back(accepted_[i].closure);
        closures_.back().verdict = ClosureVerdict::kOutvoted;
      }
    }
    accepted_ = std::move(believed);
    double largest_m = 0.0;
    for (std::size_t k = 0; k < T_map_key.size(); ++k) {
      largest_m = std::max(largest_m, distance(T_map_key[k], fitted.poses[k]));
    }
    T_map_key = fitted.poses;
    if (largest_m < kStill_m) break;
  }
  for (const Found& f : accepted_) closures_.push_back(f.closure);
  std::sort(closures_.begin(), closures_.end(), [](const Closure& a, const Closure& b) {
    return std::pair(a.from, a.to) < std::pair(b.from, b.to);
  });
  return T_map_key;
}

}  // namespace vestibule::mapping
