#include "sequence_target.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace vestibule::ekf::fuzz {
namespace {

/// Draws from given bytes instead of chance; zeros when they are used up.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  [[nodiscard]] bool empty() const { return at_ >= size_; }
  std::uint64_t below(std::uint64_t n) { return next() % n; }
  double number(double mean, double sigma) {
    const double share = (256.0 * next() + next()) / 65535.0;
    return mean + sigma * (6.0 * share - 3.0);
  }

 private:
  std::uint8_t next() { return empty() ? std::uint8_t{0} : data_[at_++]; }

  const std::uint8_t* data_;
  std::size_t size_;
  std::size_t at_ = 0;
};

}  // namespace

std::string faultOf(const MapFilter& filter) {
  if (filter.started()) {
    const PoseWithCovariance odometry = filter.odometry();
    if (!isFinite(odometry.mean) || !odometry.cov.allFinite()) return "odometry is not finite";
  }
  if (!filter.ready()) return {};
  const StateMatrix& P = filter.covariance();
  if (!filter.state().allFinite() || !P.allFinite()) return "the estimate is not finite";
  if ((P - P.transpose()).cwiseAbs().maxCoeff() != 0.0) return "the covariance is not symmetric";
  // Scaled to unit variances: states differ by fifteen orders of magnitude.
  Error scale;
  for (int i = 0; i < kStateSize; ++i) {
    if (!(P(i, i) >= 0.0)) return "negative variance of state " + std::to_string(i);
    scale[i] = P(i, i) > 0.0 ? 1.0 / std::sqrt(P(i, i)) : 0.0;
  }
  const StateMatrix correlation = scale.asDiagonal() * P * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<StateMatrix> eigen(correlation, Eigen::EigenvaluesOnly);
  const double least = eigen.eigenvalues().minCoeff();
  return least >= -1e-9 ? ""
                        : "the least eigenvalue of the correlations is " + std::to_string(least);
}

std::string feedSequence(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, size);
  FilterParams params;
  params.plane = bytes.below(2) == 0;
  params.init.trust_heading = bytes.below(2) == 0;
  params.engine = bytes.below(4) == 0 ? EngineKind::kMrpt : EngineKind::kFixed;
  MapFilter filter(params, SensorRig());
  Thrower<Bytes> thrower(bytes);
  while (!thrower.source().empty()) {
    thrower.throwAt(filter);
    std::string fault = faultOf(filter);
    if (!fault.empty()) return fault;
  }
  return {};
}

}  // namespace vestibule::ekf::fuzz
