// The only translation unit that instantiates MRPT's Kalman base (10 s of compile time).
#include <mrpt/bayes/CKalmanFilterCapable.h>

#include <Eigen/Cholesky>

#include "vestibule/core/angles.hpp"
#include "vestibule/ekf/engine.hpp"

namespace vestibule::ekf {
namespace {

/// Rows per MRPT update. MRPT fixes the size of an observation at compile time, so observations
/// are whitened and handed over in pairs; an odd last row is paired with one that says nothing.
constexpr std::size_t kRows = 2;

class MrptKalman : public mrpt::bayes::CKalmanFilterCapable<kStateSize, kRows, 0, 1> {
 public:
  MrptKalman() {
    m_xkk.setZero(kStateSize);
    m_pkk.setZero(kStateSize, kStateSize);
    KF_options.method = mrpt::bayes::kfEKFNaive;
    KF_options.enable_profiler = false;
  }

  void set(const State& x, const StateMatrix& P) {
    m_xkk.asEigen() = x;
    m_pkk.asEigen() = P;
  }
  [[nodiscard]] State state() const { return m_xkk.asEigen(); }
  [[nodiscard]] StateMatrix covariance() const { return m_pkk.asEigen(); }

  void predict(const Motion& u) {
    x_before_ = state();
    motion_ = &u;
    rows_ = nullptr;
    runOneKalmanIteration();
    motion_ = nullptr;
    symmetrise();
  }

  struct Rows {
    Eigen::Vector2d residual = Eigen::Vector2d::Zero();
    Eigen::Matrix<double, kRows, kStateSize> H = Eigen::Matrix<double, kRows, kStateSize>::Zero();
  };
  /// Rows with unit noise.
  void update(const Rows& rows) {
    motion_ = nullptr;
    rows_ = &rows;
    runOneKalmanIteration();
    rows_ = nullptr;
    m_xkk[kYaw] = wrapToPi(m_xkk[kYaw]);
    m_xkk[kHeadingOffset] = wrapToPi(m_xkk[kHeadingOffset]);
    symmetrise();
  }

 protected:
  void OnGetAction(KFArray_ACT& u) const override { u[0] = 0.0; }  // the action is motion_

  void OnTransitionModel(const KFArray_ACT&, KFArray_VEH& x, bool& skip) const override {
    skip = motion_ == nullptr;
    if (skip) return;
    const State next = PlanarModel::transition(x_before_, *motion_);
    for (int i = 0; i < kStateSize; ++i) x[i] = next[i];
  }
  void OnTransitionJacobian(KFMatrix_VxV& F) const override {
    F.asEigen() = PlanarModel::jacobian(x_before_, *motion_);
  }
  void OnTransitionNoise(KFMatrix_VxV& Q) const override {
    Q.asEigen() = PlanarModel::processNoise(x_before_, *motion_);
  }
  void OnGetObservationNoise(KFMatrix_OxO& R) const override { R.setIdentity(); }
  void OnGetObservationsAndDataAssociation(
      vector_KFArray_OBS& z,
      std::vector<int>& association,
      const vector_KFArray_OBS&,
      const KFMatrix&,
      const std::vector<size_t>&,
      const KFMatrix_OxO&) override {
    z.clear();
    association.clear();
    if (rows_ == nullptr) return;
    z.resize(1);
    for (int i = 0; i < static_cast<int>(kRows); ++i) z[0][i] = rows_->residual[i];
  }
  // z is the residual itself, so that the prediction is zero.
  void OnObservationModel(const std::vector<size_t>&, vector_KFArray_OBS& h) const override {
    h.resize(1);
    h[0].fill(0.0);
  }
  void OnObservationJacobians(size_t, KFMatrix_OxV& Hx, KFMatrix_OxF&) const override {
    if (rows_ == nullptr) {
      Hx.setZero();
    } else {
      Hx.asEigen() = rows_->H;
    }
  }

 private:
  void symmetrise() {
    const StateMatrix P = m_pkk.asEigen();
    m_pkk.asEigen() = 0.5 * (P + P.transpose());
  }

  State x_before_ = State::Zero();
  const Motion* motion_ = nullptr;
  const Rows* rows_ = nullptr;
};

class MrptEngine : public Engine {
 public:
  void set(const State& x, const StateMatrix& P) override { filter_.set(x, P); }
  void predict(const Motion& u) override { filter_.predict(u); }

  void update(const Observation& z) override {
    const Eigen::LLT<Observation::Noise> cholesky(z.R);
    const Observation::Residual residual = cholesky.matrixL().solve(z.residual);
    const Observation::Jacobian H = cholesky.matrixL().solve(z.H);
    const State linearised_at = filter_.state();
    for (int first = 0; first < z.dof(); first += static_cast<int>(kRows)) {
      // Rows in turn equal rows at once only if all keep the linearisation of the first.
      State moved = filter_.state() - linearised_at;
      moved[kYaw] = wrapToPi(moved[kYaw]);
      moved[kHeadingOffset] = wrapToPi(moved[kHeadingOffset]);
      MrptKalman::Rows rows;
      for (int i = 0; i < static_cast<int>(kRows) && first + i < z.dof(); ++i) {
        rows.H.row(i) = H.row(first + i);
        rows.residual[i] = residual[first + i] - H.row(first + i).dot(moved);
      }
      filter_.update(rows);
    }
  }

  [[nodiscard]] State state() const override { return filter_.state(); }
  [[nodiscard]] StateMatrix covariance() const override { return filter_.covariance(); }

 private:
  MrptKalman filter_;
};

}  // namespace

std::unique_ptr<Engine> makeMrptEngine() { return std::make_unique<MrptEngine>(); }

}  // namespace vestibule::ekf
