#include "cluster.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule::mapping {
namespace {

constexpr int kMaxIterations = 12;
constexpr int kWideIterations = 4;  // with the full gate; then it narrows
constexpr double kNarrowGate_m = 0.15;
constexpr double kConverged = 1e-4;  // [m], [rad]

void countOnto(
    const Cluster& a, const Cluster& b, const Pose2& T_a_b, double gate_m, Overlap& sum) {
  for (const Cluster::Member& mb : b.members) {
    const Pose2 T_a_base = compose(T_a_b, mb.T_cluster_base);
    std::vector<Pose2> views;  // T_member_base
    for (const Cluster::Member& ma : a.members) {
      views.push_back(between(ma.T_cluster_base, T_a_base));
    }
    mb.contour->forSamples([&](const ContourPoint& p) {
      ++sum.points;
      bool through = false;
      bool matched = false;
      for (std::size_t k = 0; k < views.size() && !matched; ++k) {
        const auto look = a.members[k].contour->look(transform(views[k], {p.x, p.y}), gate_m);
        through = through || look.seen_through;
        if (look.nearest == nullptr) continue;
        matched = sameSide(p, *look.nearest, std::cos(views[k].phi), std::sin(views[k].phi));
      }
      if (matched) {
        ++sum.matched;
      } else if (through) {
        ++sum.conflicting;
      }
    });
  }
}

/// The quadratic of all pairs of scans, by the change of T_a_b.
Quadratic linearise(
    const Cluster& a, const Cluster& b, const Pose2& T_a_b, const AlignmentParams& params) {
  Quadratic sum;
  for (const Cluster::Member& ma : a.members) {
    const Pose2 T_ma_a = inverse(ma.T_cluster_base);
    for (const Cluster::Member& mb : b.members) {
      const Pose2 T_ma_mb = compose(compose(T_ma_a, T_a_b), mb.T_cluster_base);
      const Quadratic q = pointToLine(*ma.contour, *mb.contour, T_ma_mb, params);
      if (q.pairs == 0) continue;
      // T_ma_mb = T_ma_a T_a_b T_b_mb by T_a_b.
      const double c = std::cos(T_ma_a.phi);
      const double s = std::sin(T_ma_a.phi);
      const double angle = T_ma_a.phi + T_a_b.phi;
      const Pose2& lever = mb.T_cluster_base;
      Eigen::Matrix3d J;
      J << c, -s, -std::sin(angle) * lever.x - std::cos(angle) * lever.y,  //
          s, c, std::cos(angle) * lever.x - std::sin(angle) * lever.y,     //
          0.0, 0.0, 1.0;
      sum.H += J.transpose() * q.H * J;
      sum.g += J.transpose() * q.g;
      sum.weighted_squares += q.weighted_squares;
      sum.weight += q.weight;
      sum.pairs += q.pairs;
    }
  }
  // The scans of a cluster see the same walls: together they say little more than one.
  const auto scans = static_cast<double>(std::max(a.members.size(), b.members.size()));
  const double share = 1.0 / std::max(1.0, scans);
  sum.H *= share;
  sum.g *= share;
  return sum;
}

}  // namespace

Overlap overlap(const Cluster& a, const Cluster& b, const Pose2& T_a_b, double gate_m) {
  Overlap sum;
  countOnto(a, b, T_a_b, gate_m, sum);
  countOnto(b, a, inverse(T_a_b), gate_m, sum);
  return sum;
}

Alignment align(
    const Cluster& a,
    const Cluster& b,
    const Pose2& start,
    const AlignmentParams& params,
    const RelativePrior& prior) {
  Alignment result;
  result.T_a_b = start;
  AlignmentParams now = params;
  for (int i = 0; i < kMaxIterations; ++i) {
    if (i >= kWideIterations) now.gate_m = std::min(params.gate_m, kNarrowGate_m);
    const Quadratic q = linearise(a, b, result.T_a_b, now);
    result.information = q.H;
    result.pairs = q.pairs;
    result.rms_m = q.weight > 0.0 ? std::sqrt(q.weighted_squares / q.weight) : 0.0;
    const Eigen::Vector3d off_prior{
        result.T_a_b.x - prior.T_a_b.x,
        result.T_a_b.y - prior.T_a_b.y,
        angleDiff(result.T_a_b.phi, prior.T_a_b.phi)};
    Eigen::Matrix3d H = q.H + prior.information;
    H.diagonal().array() += 1e-3;  // [1/m^2] nothing known: stay
    const Eigen::Vector3d step = -H.ldlt().solve(q.g + prior.information * off_prior);
    if (!step.allFinite()) break;
    result.T_a_b.x += step.x();
    result.T_a_b.y += step.y();
    result.T_a_b.phi = wrapToPi(result.T_a_b.phi + step.z());
    if (i >= kWideIterations && step.cwiseAbs().maxCoeff() < kConverged) break;
    if (i < kWideIterations && step.cwiseAbs().maxCoeff() < kConverged) i = kWideIterations - 1;
  }
  return result;
}

}  // namespace vestibule::mapping
