#include "vestibule/ekf/smoother.hpp"

#include <Eigen/LU>

namespace vestibule::ekf {
namespace {

/// What the future says: error of the filter = -P l, its covariance is smaller by P L P.
struct Adjoint {
  Error l = Error::Zero();
  StateMatrix L = StateMatrix::Zero();
};

}  // namespace

void Smoother::predicted(const Transition& step) {
  operations_.emplace_back(Predicted{step.keep, step.coupling});
}

void Smoother::updated(const StateMatrix& P, const Observation& z) {
  Updated u;
  u.rows = z.rows;
  u.H.setZero();
  u.K.setZero();
  u.S_inverse.setZero();
  u.residual.setZero();
  const int m = z.rows;
  u.H.topRows(m) = z.H.topRows(m);
  u.residual.head(m) = z.residual.head(m);
  const Eigen::MatrixXd W = P * z.H.topRows(m).transpose();
  const Eigen::MatrixXd S = z.H.topRows(m) * W + z.R.topLeftCorner(m, m);
  u.S_inverse.topLeftCorner(m, m) = S.inverse();
  u.K.leftCols(m) = W * u.S_inverse.topLeftCorner(m, m);
  operations_.emplace_back(u);
}

void Smoother::mark(Timestamp stamp, const State& x, const StateMatrix& P) {
  operations_.emplace_back(Mark{marks_.size()});
  marks_.push_back({stamp, x, P});
}

std::vector<Smoother::Smoothed> Smoother::smooth() const {
  std::vector<Smoothed> result = marks_;
  Adjoint a;
  for (auto op = operations_.rbegin(); op != operations_.rend(); ++op) {
    if (const auto* step = std::get_if<Predicted>(&*op)) {
      StateMatrix F = step->keep.asDiagonal();
      F.topRows<Transition::kTop>() += step->coupling;
      a.l = F.transpose() * a.l;
      a.L = F.transpose() * a.L * F;
    } else if (const auto* update = std::get_if<Updated>(&*op)) {
      const StateMatrix A = StateMatrix::Identity() - update->K * update->H;
      const Eigen::Matrix<double, kStateSize, 3> Ht_S = update->H.transpose() * update->S_inverse;
      a.l = (A.transpose() * a.l - Ht_S * update->residual).eval();
      a.L = (A.transpose() * a.L * A + Ht_S * update->H).eval();
    } else if (const auto* mark = std::get_if<Mark>(&*op)) {
      Smoothed& s = result[mark->index];
      s.x = plus(s.x, -(s.P * a.l));
      const StateMatrix P = s.P - s.P * a.L * s.P;
      s.P = 0.5 * (P + P.transpose());
    } else if (const auto* replaced = std::get_if<Replaced>(&*op)) {
      for (int i = replaced->first; i < replaced->first + replaced->count; ++i) {
        a.l[i] = 0.0;
        a.L.row(i).setZero();
        a.L.col(i).setZero();
      }
    } else {
      a = {};
    }
  }
  return result;
}

}  // namespace vestibule::ekf
