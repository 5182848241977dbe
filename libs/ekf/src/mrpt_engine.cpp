// The only translation unit that instantiates MRPT's Kalman base.
#include <mrpt/bayes/CKalmanFilterCapable.h>

#include <Eigen/Cholesky>
#include <sstream>
#include <string>

#include "vestibule/ekf/engine.hpp"

// Debian's libmrpt-math has fixed-size matrices of a few sizes only, and the files that define
// these members for others are not installed. 24 x 24, 3 x 24 and 3 x 3 need them.
namespace mrpt::math {
template <class Scalar, class Derived>
Scalar MatrixVectorBase<Scalar, Derived>::sum_abs() const {
  return mvbDerived().asEigen().array().abs().sum();
}
template <class Scalar, class Derived>
Derived MatrixVectorBase<Scalar, Derived>::impl_op_subs(const Derived& other) const {
  Derived result;
  result.asEigen() = mvbDerived().asEigen() - other.asEigen();
  return result;
}
template <class Scalar, class Derived>
void MatrixVectorBase<Scalar, Derived>::impl_op_selfsubs(const Derived& other) {
  mvbDerived().asEigen() -= other.asEigen();
}
template <class Scalar, class Derived>
std::string MatrixVectorBase<Scalar, Derived>::asString() const {
  std::ostringstream text;
  text << mvbDerived().asEigen();
  return text.str();
}
}  // namespace mrpt::math

namespace vestibule::ekf {
namespace {

/// MRPT fixes the size of an observation at compile time: rows that are not there get unit noise
/// and say nothing.
constexpr std::size_t kRows = Observation::kMaxRows;

/// MRPT's filter over the error vector, which is zero before every operation.
class MrptKalman : public mrpt::bayes::CKalmanFilterCapable<kStateSize, kRows, 0, 1> {
 public:
  MrptKalman() {
    m_xkk.setZero(kStateSize);
    m_pkk.setZero(kStateSize, kStateSize);
    KF_options.method = mrpt::bayes::kfEKFNaive;
    KF_options.enable_profiler = false;
  }

  void predict(StateMatrix& P, const Transition& step) { run(P, &step, nullptr); }
  Error update(StateMatrix& P, const Observation& z) {
    // MRPT's covariance (I - K H) P loses its definiteness when a measurement is a million times
    // better than the estimate: the same gain goes into the Joseph form.
    const int m = z.rows;
    const Error before = P.diagonal();
    const Eigen::MatrixXd H = z.H.topRows(m);
    const Eigen::MatrixXd R = z.R.topLeftCorner(m, m);
    const Eigen::MatrixXd W = P * H.transpose();
    const Eigen::MatrixXd K = (H * W + R).llt().solve(W.transpose()).transpose();
    const StateMatrix A = StateMatrix::Identity() - K * H;
    StateMatrix joseph = A * P * A.transpose() + K * R * K.transpose();
    run(P, nullptr, &z);
    P = 0.5 * (joseph + joseph.transpose());
    P.diagonal() += kRoundingGuard * (before + P.diagonal());
    return m_xkk.asEigen();
  }

 protected:
  void OnGetAction(KFArray_ACT& u) const override { u[0] = 0.0; }
  void OnTransitionModel(const KFArray_ACT&, KFArray_VEH& x, bool& skip) const override {
    skip = step_ == nullptr;
    if (!skip) x.fill(0.0);
  }
  void OnTransitionJacobian(KFMatrix_VxV& F) const override { F.asEigen() = step_->F(); }
  void OnTransitionNoise(KFMatrix_VxV& Q) const override { Q.asEigen() = step_->Q(); }
  void OnGetObservationNoise(KFMatrix_OxO& R) const override {
    R.setIdentity();
    if (z_ != nullptr) {
      R.asEigen().topLeftCorner(z_->rows, z_->rows) = z_->R.topLeftCorner(z_->rows, z_->rows);
    }
  }
  void OnGetObservationsAndDataAssociation(
      vector_KFArray_OBS& z,
      std::vector<int>& association,
      const vector_KFArray_OBS&,
      const KFMatrix&,
      const std::vector<size_t>&,
      const KFMatrix_OxO&) override {
    z.clear();
    association.clear();
    if (z_ == nullptr) return;
    z.resize(1);
    z[0].fill(0.0);
    for (int i = 0; i < z_->rows; ++i) z[0][i] = z_->residual[i];
  }
  // z is the residual itself, so that the prediction is zero.
  void OnObservationModel(const std::vector<size_t>&, vector_KFArray_OBS& h) const override {
    h.resize(1);
    h[0].fill(0.0);
  }
  void OnObservationJacobians(size_t, KFMatrix_OxV& Hx, KFMatrix_OxF&) const override {
    Hx.setZero();
    if (z_ != nullptr) Hx.asEigen().topRows(z_->rows) = z_->H.topRows(z_->rows);
  }

 private:
  void run(StateMatrix& P, const Transition* step, const Observation* z) {
    const Error before = P.diagonal();
    step_ = step;
    z_ = z;
    m_xkk.asEigen().setZero();
    m_pkk.asEigen() = P;
    runOneKalmanIteration();
    P = m_pkk.asEigen();
    P = (0.5 * (P + P.transpose())).eval();
    P.diagonal() += kRoundingGuard * (before + P.diagonal());
  }

  const Transition* step_ = nullptr;
  const Observation* z_ = nullptr;
};

class MrptEngine : public Engine {
 public:
  void predict(StateMatrix& P, const Transition& step) const override { filter_.predict(P, step); }
  Error update(StateMatrix& P, const Observation& z, const Correlation&) const override {
    return filter_.update(P, z);
  }

 private:
  mutable MrptKalman filter_;  // work space only
};

}  // namespace

std::unique_ptr<const Engine> makeMrptEngine() { return std::make_unique<MrptEngine>(); }

}  // namespace vestibule::ekf
