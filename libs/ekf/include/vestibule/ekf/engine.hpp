#pragma once

#include <memory>

#include "vestibule/core/simd.hpp"
#include "vestibule/ekf/model.hpp"

namespace vestibule::ekf {

/// What an estimate and a measurement have in common, whatever the measurement's noise.
struct Correlation {
  Eigen::Matrix<double, kStateSize, Observation::kMaxRows> PH;  ///< P H', first `rows` columns
  Eigen::Matrix3d HPH;                                          ///< H P H', symmetric
};

/// How far a measurement is from what is expected.
struct Innovation {
  double nis = 0.0;      ///< residual' S^-1 residual; infinite where S is no covariance
  double log_det = 0.0;  ///< log |S|
  Eigen::Matrix3d S = Eigen::Matrix3d::Identity();  ///< its first `rows` rows and columns
};

/// Runs the Kalman equations on a covariance. Knows nothing of the robot; keeps no state of its
/// own, so that one engine serves any number of filters in one thread.
///
/// The covariance stays symmetric to the bit and positive semi-definite: each operation adds to
/// every variance more than rounding can have taken from it (see kRoundingGuard).
class Engine {
 public:
  Engine() = default;
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;
  virtual ~Engine() = default;

  /// P = F P F' + Q.
  virtual void predict(StateMatrix& P, const Transition& step) const = 0;
  /// \pre R positive definite; c = correlation(P, z)
  /// \return the correction of the state
  [[nodiscard]] virtual Error update(
      StateMatrix& P, const Observation& z, const Correlation& c) const = 0;
  [[nodiscard]] Error update(StateMatrix& P, const Observation& z) const {
    return update(P, z, correlation(P, z));
  }
  [[nodiscard]] static Correlation correlation(const StateMatrix& P, const Observation& z);
  [[nodiscard]] static Innovation innovation(const Observation& z, const Correlation& c);
};

/// Fixed-size algebra that leaves out what is zero by structure. \param planar  of the model
/// \param simd  what it runs on; the same bits with each
[[nodiscard]] std::unique_ptr<const Engine> makeFixedEngine(bool planar, Simd simd = bestSimd());
/// On mrpt::bayes::CKalmanFilterCapable.
[[nodiscard]] std::unique_ptr<const Engine> makeMrptEngine();

/// Rounding of a sum of products p_ij changes it by at most c eps sqrt(p_ii p_jj). Scaled to unit
/// variances that is a matrix of norm below n c eps, so adding that share of the variances before
/// and after the operation keeps the result positive semi-definite.
inline constexpr double kRoundingGuard = 1e-13;

}  // namespace vestibule::ekf
