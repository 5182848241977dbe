#include "vestibule/mapping/pose_graph.hpp"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <string>

#include "vestibule/core/angles.hpp"

namespace vestibule::mapping {
namespace {

using Sparse = Eigen::SparseMatrix<double>;
constexpr double kMuStep = 1.4;  // the control parameter shrinks by this
constexpr int kMaxGncSteps = 60;
constexpr double kConverged_m = 1e-5;  // largest change of a coordinate
constexpr double kDamping = 1e-6;

/// Derivatives of T_from_to = (x, y, yaw) by the two poses.
struct Jacobians {
  Eigen::Matrix3d from;
  Eigen::Matrix3d to;
};

Jacobians jacobians(const Pose2& T_map_from, const Pose2& T_map_to) {
  const double c = std::cos(T_map_from.phi);
  const double s = std::sin(T_map_from.phi);
  const double dx = T_map_to.x - T_map_from.x;
  const double dy = T_map_to.y - T_map_from.y;
  Jacobians J;
  J.to << c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0;
  J.from << -c, -s, -s * dx + c * dy, s, -c, -c * dx - s * dy, 0.0, 0.0, -1.0;
  return J;
}

/// The normal equations of all nodes but the first. The pattern of one call serves the next: the
/// pairs must be the same.
class NormalEquations {
 public:
  explicit NormalEquations(std::size_t nodes) : size_(3 * (static_cast<int>(nodes) - 1)) {}

  /// Change of all poses but the first; empty when the equations cannot be solved.
  Eigen::VectorXd solve(
      const std::vector<Pose2>& poses, const std::vector<PairQuadratic>& pairs, double damping) {
    // Each node's own block is the sum over all its pairs; only what is beside it needs a list.
    std::vector<Eigen::Matrix3d> own(
        static_cast<std::size_t>(size_ / 3), damping * Eigen::Matrix3d::Identity());
    triplets_.reserve(9 * pairs.size() + 6 * own.size());
    Eigen::VectorXd rhs = Eigen::VectorXd::Zero(size_);
    for (const PairQuadratic& pair : pairs) {
      const Jacobians J = jacobians(poses[pair.from], poses[pair.to]);
      const int a = 3 * (static_cast<int>(pair.from) - 1);
      const int b = 3 * (static_cast<int>(pair.to) - 1);
      const Eigen::Matrix3d HJb = pair.H * J.to;
      const Eigen::Matrix3d HJa = pair.H * J.from;
      if (a >= 0) own[pair.from - 1] += J.from.transpose() * HJa;
      if (b >= 0) own[pair.to - 1] += J.to.transpose() * HJb;
      if (a >= 0 && b >= 0) {
        if (a > b) {
          addBlock(a, b, J.from.transpose() * HJb);
        } else {
          addBlock(b, a, J.to.transpose() * HJa);
        }
      }
      if (a >= 0) rhs.segment<3>(a) -= J.from.transpose() * pair.g;
      if (b >= 0) rhs.segment<3>(b) -= J.to.transpose() * pair.g;
    }
    for (std::size_t i = 0; i < own.size(); ++i) {
      addBlock(3 * static_cast<int>(i), 3 * static_cast<int>(i), own[i]);
    }
    Sparse H(size_, size_);
    H.setFromTriplets(triplets_.begin(), triplets_.end());
    triplets_ = {};  // the factor needs the memory
    if (!analysed_) solver_.analyzePattern(H);
    analysed_ = true;
    solver_.factorize(H);
    if (solver_.info() != Eigen::Success) return {};
    return solver_.solve(rhs);
  }

 private:
  // Lower triangle only.
  void addBlock(int row, int col, const Eigen::Matrix3d& block) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        if (row + r >= col + c) triplets_.emplace_back(row + r, col + c, block(r, c));
      }
    }
  }

  int size_;
  std::vector<Eigen::Triplet<double>> triplets_;
  Eigen::SimplicialLDLT<Sparse> solver_;
  bool analysed_ = false;
};

double apply(const Eigen::VectorXd& change, std::vector<Pose2>& poses) {
  double largest = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Eigen::Vector3d d = change.segment<3>(3 * (static_cast<Eigen::Index>(i) - 1));
    poses[i].x += d.x();
    poses[i].y += d.y();
    poses[i].phi = wrapToPi(poses[i].phi + d.z());
    largest = std::max(largest, d.cwiseAbs().maxCoeff());
  }
  return largest;
}

double chi2(const PoseConstraint& constraint, const std::vector<Pose2>& poses) {
  const Eigen::Vector3d r = residual(constraint, poses);
  return r.dot(constraint.information * r);
}

/// Levenberg-Marquardt with the present weights.
class Minimiser {
 public:
  Minimiser(const std::vector<PoseConstraint>& constraints, std::size_t nodes)
      : constraints_(constraints), equations_(nodes) {}

  int run(std::vector<Pose2>& poses, const std::vector<double>& weights, int max_iterations) {
    double damping = kDamping;
    double cost = costOf(poses, weights);
    int i = 0;
    while (i < max_iterations) {
      ++i;
      const Eigen::VectorXd change = equations_.solve(poses, quadratics(poses, weights), damping);
      if (change.size() == 0 || !change.allFinite()) {
        damping = std::max(damping, 1e-3) * 100.0;
        continue;
      }
      std::vector<Pose2> next = poses;
      const double largest = apply(change, next);
      const double next_cost = costOf(next, weights);
      if (next_cost > cost) {
        if (largest < kConverged_m) break;
        damping = std::max(damping, 1e-3) * 10.0;
        if (damping > 1e12) break;
        continue;
      }
      const bool done = largest < kConverged_m || cost - next_cost < 1e-9 * cost;
      poses = std::move(next);
      cost = next_cost;
      damping = std::max(kDamping, damping * 0.1);
      if (done) break;
    }
    return i;
  }

  double costOf(const std::vector<Pose2>& poses, const std::vector<double>& weights) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < constraints_.size(); ++k) {
      sum += weights[k] * chi2(constraints_[k], poses);
    }
    return sum;
  }

 private:
  std::vector<PairQuadratic> quadratics(
      const std::vector<Pose2>& poses, const std::vector<double>& weights) const {
    std::vector<PairQuadratic> pairs;
    pairs.reserve(constraints_.size());
    for (std::size_t k = 0; k < constraints_.size(); ++k) {
      const PoseConstraint& c = constraints_[k];
      const Eigen::Matrix3d H = weights[k] * c.information;
      pairs.push_back({c.from, c.to, H, H * residual(c, poses)});
    }
    return pairs;
  }

  const std::vector<PoseConstraint>& constraints_;
  NormalEquations equations_;
};

}  // namespace

Eigen::Vector3d residual(const PoseConstraint& constraint, const std::vector<Pose2>& poses) {
  const Pose2 T = between(poses[constraint.from], poses[constraint.to]);
  return {
      T.x - constraint.T_from_to.x,
      T.y - constraint.T_from_to.y,
      angleDiff(T.phi, constraint.T_from_to.phi)};
}

PoseGraphResult optimisePoseGraph(
    std::vector<Pose2> poses,
    const std::vector<PoseConstraint>& constraints,
    const PoseGraphParams& params) {
  PoseGraphResult result;
  result.weights.assign(constraints.size(), 1.0);
  if (poses.size() > 1) {
    Minimiser minimiser(constraints, poses.size());
    double worst = 0.0;
    for (const PoseConstraint& c : constraints) {
      if (c.doubtful) worst = std::max(worst, chi2(c, poses));
    }
    // A large mu takes all doubtful constraints for imprecise as well as convex, so that the chain
    // outweighs them: what needs it bent by many sigma stays an outlier while mu shrinks.
    double mu = std::max(1.0, worst / params.inlier_chi2);
    for (int step = 0; step < kMaxGncSteps; ++step) {
      for (std::size_t k = 0; k < constraints.size(); ++k) {
        if (!constraints[k].doubtful) continue;
        const double scale = mu * params.inlier_chi2;
        const double w = scale / (scale + chi2(constraints[k], poses));
        result.weights[k] = w * w / mu;
      }
      const bool last = mu <= 1.0;
      // Between two steps the weights only need to follow roughly.
      result.iterations += minimiser.run(poses, result.weights, last ? params.max_iterations : 2);
      if (last) break;
      mu = std::max(1.0, mu / kMuStep);
    }
    result.chi2 = minimiser.costOf(poses, result.weights);
  }
  result.poses = std::move(poses);
  return result;
}

std::vector<Pose2> stepped(
    const std::vector<Pose2>& poses, const std::vector<PairQuadratic>& pairs, double damping) {
  std::vector<Pose2> next = poses;
  if (poses.size() < 2) return next;
  NormalEquations equations(poses.size());
  const Eigen::VectorXd change = equations.solve(poses, pairs, damping);
  if (change.size() > 0 && change.allFinite()) apply(change, next);
  return next;
}

std::string g2oOf(const std::vector<Pose2>& poses, const std::vector<PoseConstraint>& constraints) {
  std::string text;
  std::array<char, 512> line{};
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Pose2& T = poses[i];
    std::snprintf(line.data(), line.size(), "VERTEX_SE2 %zu %.9g %.9g %.9g\n", i, T.x, T.y, T.phi);
    text += line.data();
  }
  if (!poses.empty()) text += "FIX 0\n";
  for (const PoseConstraint& c : constraints) {
    const Pose2& T = c.T_from_to;
    const Eigen::Matrix3d& I = c.information;
    std::snprintf(
        line.data(),
        line.size(),
        "EDGE_SE2 %zu %zu %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n",
        c.from,
        c.to,
        T.x,
        T.y,
        T.phi,
        I(0, 0),
        I(0, 1),
        I(0, 2),
        I(1, 1),
        I(1, 2),
        I(2, 2));
    text += line.data();
  }
  return text;
}

}  // namespace vestibule::mapping
