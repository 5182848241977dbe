#include <Eigen/Cholesky>
#include <array>
#include <cmath>
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

/// The errors there are: in the plane, the others' rows and columns stay zero and are left out.
template <bool planar>
struct Axes {
  static constexpr int kCount = planar ? kStateSize - __builtin_popcount(kSpatial) : kStateSize;
  static constexpr std::array<int, kCount> all() {
    std::array<int, kCount> list{};
    std::size_t n = 0;
    for (unsigned i = 0; i < kStateSize; ++i) {
      if (!planar || (kSpatial >> i & 1U) == 0U) list[n++] = static_cast<int>(i);
    }
    return list;
  }
  static constexpr std::array<int, kCount> kAll = all();
  static constexpr int kTopCount =
      planar ? kTop - __builtin_popcount(kSpatial & ((1U << kTop) - 1U)) : kTop;
};

template <bool planar>
class FixedEngine : public Engine {
 public:
  void predict(StateMatrix& P, const Transition& step) const override {
    // T = (F P)', first rows only: columns of P are contiguous.
    std::array<Error, n> T;
    for (int a = 0; a < n; ++a) {
      const int i = kAll[a];
      T[a].noalias() = step.keep[i] * P.col(i);
    }
    forEachColumn(step.columns, [&](int j) {
      for (int a = 0; a < n; ++a) {
        const double share = step.coupling(kAll[a], j);
        if (share != 0.0) T[a] += share * P.col(j);
      }
    });
    const Error before = P.diagonal();
    for (int b = 0; b < n; ++b) {
      const int k = kAll[b];
      // A column of F P F' + Q in the first rows.
      Eigen::Matrix<double, kTop, 1> column =
          step.keep.template head<kTop>().cwiseProduct(T[b].template head<kTop>()) +
          step.top_noise.col(k);
      forEachColumn(step.columns, [&](int j) { column += T[b][j] * step.coupling.col(j); });
      for (int a = b; a < n; ++a) P(kAll[a], k) = P(k, kAll[a]) = column[kAll[a]];
      P.col(k).template tail<kRest>() =
          T[b].template tail<kRest>().cwiseProduct(step.keep.template tail<kRest>());
    }
    for (std::size_t r = n; r < kAll.size(); ++r) {
      const int i = kAll[r];
      for (int a = 0; a < n; ++a) P(kAll[a], i) = P(i, kAll[a]);
      if (step.keep[i] != 1.0) {
        P.col(i).template tail<kRest>() *= step.keep[i];
        P.row(i).template tail<kRest>() *= step.keep[i];
      }
      P(i, i) += step.rest_noise[i - kTop];
    }
    guard(P, before);
  }

  Error update(StateMatrix& P, const Observation& z, const Correlation& c) const override {
    switch (z.rows) {
      case 1:
        return updateRows<1>(P, z, c);
      case 2:
        return updateRows<2>(P, z, c);
      default:
        return updateRows<3>(P, z, c);
    }
  }

 private:
  static constexpr auto kAll = Axes<planar>::kAll;
  static constexpr int n = Axes<planar>::kTopCount;

  static void guard(StateMatrix& P, const Error& before) {
    for (const int i : kAll) P(i, i) += kRoundingGuard * (before[i] + P(i, i));
  }

  template <int m>
  static Error updateRows(StateMatrix& P, const Observation& z, const Correlation& c) {
    using Square = Eigen::Matrix<double, m, m>;
    const Square S = c.HPH.template topLeftCorner<m, m>() + z.R.template topLeftCorner<m, m>();
    // P - W S^-1 W' = P - V V' with V = W L^-T and S = L L': symmetric to the bit.
    const Eigen::LLT<Square> cholesky(S);
    const Square L = cholesky.matrixL();
    Eigen::Matrix<double, kStateSize, m> V;
    Eigen::Matrix<double, m, 1> white;
    for (int i = 0; i < m; ++i) {
      V.col(i) = c.PH.col(i);
      white[i] = z.residual[i];
      for (int k = 0; k < i; ++k) {
        V.col(i) -= L(i, k) * V.col(k);
        white[i] -= L(i, k) * white[k];
      }
      V.col(i) *= 1.0 / L(i, i);
      white[i] /= L(i, i);
    }
    const Error before = P.diagonal();
    for (const int j : kAll) {
      for (int i = 0; i < m; ++i) P.col(j) -= V(j, i) * V.col(i);
    }
    guard(P, before);
    return V * white;
  }
};

template <int m>
Correlation correlationOf(const StateMatrix& P, const Observation& z) {
  Correlation c;
  auto PH = c.PH.leftCols<m>();
  PH.setZero();
  forEachColumn(z.columns, [&](int j) {
    for (int i = 0; i < m; ++i) {
      if (z.H(i, j) != 0.0) PH.col(i) += z.H(i, j) * P.col(j);
    }
  });
  Eigen::Matrix<double, m, m> HPH = Eigen::Matrix<double, m, m>::Zero();
  forEachColumn(z.columns, [&](int j) {
    for (int i = 0; i < m; ++i) HPH.col(i) += PH(j, i) * z.H.col(j).template head<m>();
  });
  c.HPH.setZero();
  c.HPH.topLeftCorner<m, m>() = 0.5 * (HPH + HPH.transpose());
  return c;
}

template <int m>
Innovation innovationOf(const Observation& z, const Correlation& c) {
  Innovation result;
  result.S.setIdentity();
  result.S.topLeftCorner<m, m>() = c.HPH.topLeftCorner<m, m>() + z.R.topLeftCorner<m, m>();
  const Eigen::LLT<Eigen::Matrix<double, m, m>> cholesky(
      result.S.topLeftCorner<m, m>().template selfadjointView<Eigen::Lower>());
  if (cholesky.info() != Eigen::Success) {
    result.nis = result.log_det = std::numeric_limits<double>::infinity();
    return result;
  }
  result.nis = cholesky.matrixL().solve(z.residual.template head<m>()).squaredNorm();
  double product = 1.0;
  for (int i = 0; i < m; ++i) product *= cholesky.matrixLLT()(i, i);
  result.log_det = 2.0 * std::log(product);
  return result;
}

}  // namespace

Correlation Engine::correlation(const StateMatrix& P, const Observation& z) {
  switch (z.rows) {
    case 1:
      return correlationOf<1>(P, z);
    case 2:
      return correlationOf<2>(P, z);
    default:
      return correlationOf<3>(P, z);
  }
}

Innovation Engine::innovation(const Observation& z, const Correlation& c) {
  switch (z.rows) {
    case 1:
      return innovationOf<1>(z, c);
    case 2:
      return innovationOf<2>(z, c);
    default:
      return innovationOf<3>(z, c);
  }
}

std::unique_ptr<const Engine> makeFixedEngine(bool planar) {
  if (planar) return std::make_unique<FixedEngine<true>>();
  return std::make_unique<FixedEngine<false>>();
}

}  // namespace vestibule::ekf
