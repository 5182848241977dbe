#include <Eigen/Cholesky>
#include <limits>

#include "vestibule/ekf/engine.hpp"

namespace vestibule::ekf {
namespace {

constexpr int kTop = Transition::kTop;
constexpr int kRest = Transition::kRest;

/// Calls visit(j) for every set bit.
template <class Visit>
void forEachColumn(std::uint32_t columns, const Visit& visit) {
  for (; columns != 0U; columns &= columns - 1U) visit(__builtin_ctz(columns));
}

class FixedEngine : public Engine {
 public:
  void predict(StateMatrix& P, const Transition& step) const override {
    const Error before = P.diagonal();
    // T = F P, first rows, transposed: columns of P are contiguous.
    Eigen::Matrix<double, kStateSize, kTop> T;
    for (int i = 0; i < kTop; ++i) T.col(i) = step.keep[i] * P.col(i);
    forEachColumn(step.columns, [&](int j) {
      const Error column = P.col(j);
      for (int i = 0; i < kTop; ++i) T.col(i) += step.coupling(i, j) * column;
    });
    // F P F' for the first rows: only the columns that F takes from.
    Eigen::Matrix<double, kTop, kTop> N = T.topRows<kTop>();
    for (int i = 0; i < kTop; ++i) N.row(i) *= step.keep[i];
    forEachColumn(step.columns, [&](int j) { N.noalias() += step.coupling.col(j) * T.row(j); });
    N += step.top_noise;
    P.topLeftCorner<kTop, kTop>().triangularView<Eigen::Lower>() = N;
    P.topLeftCorner<kTop, kTop>().triangularView<Eigen::StrictlyUpper>() = N.transpose();
    const auto keep = step.keep.tail<kRest>();
    for (int i = 0; i < kTop; ++i) {
      P.col(i).tail<kRest>() = T.col(i).tail<kRest>().cwiseProduct(keep);
    }
    P.topRightCorner<kTop, kRest>() = P.bottomLeftCorner<kRest, kTop>().transpose();
    for (int i = kTop; i < kStateSize; ++i) {
      if (step.keep[i] == 1.0) continue;
      P.col(i).tail<kRest>() *= step.keep[i];
      P.row(i).tail<kRest>() *= step.keep[i];
    }
    P.diagonal().tail<kRest>() += step.rest_noise;
    P.diagonal() += kRoundingGuard * (before + P.diagonal());
  }

  Error update(StateMatrix& P, const Observation& z) const override {
    switch (z.rows) {
      case 1:
        return updateRows<1>(P, z);
      case 2:
        return updateRows<2>(P, z);
      default:
        return updateRows<3>(P, z);
    }
  }

 private:
  template <int m>
  static Error updateRows(StateMatrix& P, const Observation& z) {
    const Error before = P.diagonal();
    Eigen::Matrix<double, kStateSize, m> W = Eigen::Matrix<double, kStateSize, m>::Zero();  // P H'
    forEachColumn(z.columns, [&](int j) {
      for (int i = 0; i < m; ++i) W.col(i) += z.H(i, j) * P.col(j);
    });
    Eigen::Matrix<double, m, m> S = z.R.template topLeftCorner<m, m>();
    forEachColumn(
        z.columns, [&](int j) { S.noalias() += z.H.col(j).template head<m>() * W.row(j); });
    S = (0.5 * (S + S.transpose())).eval();
    // P - W S^-1 W' = P - V V' with V = W L^-T and S = L L': symmetric to the bit.
    const Eigen::LLT<Eigen::Matrix<double, m, m>> cholesky(S);
    const Eigen::Matrix<double, kStateSize, m> V =
        cholesky.matrixL().solve(W.transpose()).transpose();
    const Eigen::Matrix<double, m, 1> white =
        cholesky.matrixL().solve(z.residual.template head<m>());
    for (int j = 0; j < kStateSize; ++j) {
      for (int i = 0; i < m; ++i) P.col(j) -= V(j, i) * V.col(i);
    }
    P.diagonal() += kRoundingGuard * (before + P.diagonal());
    return V * white;
  }
};

}  // namespace

Innovation Engine::innovation(const StateMatrix& P, const Observation& z) const {
  Innovation result;
  Eigen::Matrix<double, 3, kStateSize> HP = Eigen::Matrix<double, 3, kStateSize>::Zero();
  forEachColumn(
      z.columns, [&](int j) { HP.topRows(z.rows) += z.H.col(j).head(z.rows) * P.row(j); });
  result.S.setIdentity();
  auto S = result.S.topLeftCorner(z.rows, z.rows);
  S = z.R.topLeftCorner(z.rows, z.rows);
  forEachColumn(
      z.columns, [&](int j) { S += HP.col(j).head(z.rows) * z.H.col(j).head(z.rows).transpose(); });
  result.S = (0.5 * (result.S + result.S.transpose())).eval();
  Eigen::Vector3d residual = z.residual;
  residual.tail(3 - z.rows).setZero();
  const Eigen::LLT<Eigen::Matrix3d> cholesky(result.S);
  result.nis = cholesky.info() == Eigen::Success ? residual.dot(cholesky.solve(residual))
                                                 : std::numeric_limits<double>::infinity();
  return result;
}

std::unique_ptr<const Engine> makeFixedEngine() { return std::make_unique<FixedEngine>(); }

}  // namespace vestibule::ekf
