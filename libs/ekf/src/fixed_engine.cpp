#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <limits>

#include "vestibule/core/simd.hpp"
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

/// Four numbers that are worked on at once, wherever they lie. What was just written in smaller
/// pieces is slow to read as one: the loops below go from memory to memory in quads.
typedef double Quad __attribute__((vector_size(32), aligned(8), may_alias));
constexpr int kLanes = 4;
constexpr int kQuads = kStateSize / kLanes;
static_assert(kQuads * kLanes == kStateSize);

VESTIBULE_INLINE Quad* quads(double* column) { return reinterpret_cast<Quad*>(column); }
VESTIBULE_INLINE const Quad* quads(const double* column) {
  return reinterpret_cast<const Quad*>(column);
}

/// P = F P F' + Q without the guard.
template <bool planar>
VESTIBULE_INLINE void predictWith(StateMatrix& P, const Transition& step) {
  static constexpr auto kAll = Axes<planar>::kAll;
  constexpr int n = Axes<planar>::kTopCount;
  constexpr int kTopQuads = n / kLanes;
  static_assert(n == kTopQuads * kLanes + 1);
  // The coupling's columns, first rows that there are.
  std::array<int, kStateSize> columns;
  std::array<std::array<double, n>, kStateSize> coupling;
  int count = 0;
  for (std::uint32_t left = step.columns; left != 0U; left &= left - 1U) {
    columns[count] = __builtin_ctz(left);
    for (int a = 0; a < n; ++a) coupling[count][a] = step.coupling(kAll[a], columns[count]);
    ++count;
  }
  // T = (F P)', first rows only: columns of P are contiguous.
  std::array<std::array<double, kStateSize>, n> T;
  for (int a = 0; a < n; ++a) {
    Quad sum[kQuads];
    const Quad* own = quads(P.col(kAll[a]).data());
    for (int q = 0; q < kQuads; ++q) sum[q] = step.keep[kAll[a]] * own[q];
    for (int c = 0; c < count; ++c) {
      const double share = coupling[c][a];
      if (share == 0.0) continue;
      const Quad* other = quads(P.col(columns[c]).data());
      for (int q = 0; q < kQuads; ++q) sum[q] += share * other[q];
    }
    for (int q = 0; q < kQuads; ++q) quads(T[a].data())[q] = sum[q];
  }
  for (int b = 0; b < n; ++b) {
    const int k = kAll[b];
    // A column of F P F' + Q in the first rows: quads and one more.
    const auto own = [&](int a) {
      return step.keep[kAll[a]] * T[b][kAll[a]] + step.top_noise(kAll[a], k);
    };
    Quad sum[kTopQuads];
    for (int q = 0; q < kTopQuads; ++q) {
      const int a = kLanes * q;
      sum[q] = Quad{own(a), own(a + 1), own(a + 2), own(a + 3)};
    }
    double last = own(n - 1);
    for (int c = 0; c < count; ++c) {
      const double share = T[b][columns[c]];
      for (int q = 0; q < kTopQuads; ++q) sum[q] += share * quads(coupling[c].data())[q];
      last += share * coupling[c][n - 1];
    }
    std::array<double, n> column;
    for (int q = 0; q < kTopQuads; ++q) quads(column.data())[q] = sum[q];
    column[n - 1] = last;
    for (int a = b; a < n; ++a) P(kAll[a], k) = P(k, kAll[a]) = column[a];
    for (int i = kTop; i < kStateSize; ++i) P(i, k) = T[b][i] * step.keep[i];
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
}

/// P = P - W S^-1 W' = P - V V' with V = W L^-T and S = L L': symmetric to the bit; without the
/// guard. \return V white
template <bool planar, int m>
VESTIBULE_INLINE Error updateWith(
    StateMatrix& P,
    const Correlation& c,
    const Eigen::Matrix<double, m, m>& L,
    const std::array<double, m>& white) {
  std::array<std::array<double, kStateSize>, m> V;
  Error correction;
  for (int q = 0; q < kQuads; ++q) {
    Quad sum{};
    for (int i = 0; i < m; ++i) {
      Quad v = quads(c.PH.col(i).data())[q];
      for (int k = 0; k < i; ++k) v -= L(i, k) * quads(V[k].data())[q];
      v *= 1.0 / L(i, i);
      quads(V[i].data())[q] = v;
      sum += white[i] * v;
    }
    quads(correction.data())[q] = sum;
  }
  for (const int j : Axes<planar>::kAll) {
    Quad* column = quads(P.col(j).data());
    for (int q = 0; q < kQuads; ++q) {
      Quad rest = column[q];
      for (int i = 0; i < m; ++i) rest -= V[i][j] * quads(V[i].data())[q];
      column[q] = rest;
    }
  }
  return correction;
}

template <bool planar>
class FixedEngine : public Engine {
 public:
  explicit FixedEngine(Simd simd) : simd_(simd) {}

  void predict(StateMatrix& P, const Transition& step) const override {
    const Error before = P.diagonal();
    predictIn(simd_, P, step);
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
  static void guard(StateMatrix& P, const Error& before) {
    for (const int i : Axes<planar>::kAll) P(i, i) += kRoundingGuard * (before[i] + P(i, i));
  }

  template <int m>
  Error updateRows(StateMatrix& P, const Observation& z, const Correlation& c) const {
    using Square = Eigen::Matrix<double, m, m>;
    const Square S = c.HPH.template topLeftCorner<m, m>() + z.R.template topLeftCorner<m, m>();
    const Eigen::LLT<Square> cholesky(S);
    const Square L = cholesky.matrixL();
    std::array<double, m> white;
    for (int i = 0; i < m; ++i) {
      white[i] = z.residual[i];
      for (int k = 0; k < i; ++k) white[i] -= L(i, k) * white[k];
      white[i] /= L(i, i);
    }
    const Error before = P.diagonal();
    const Error correction = updateIn<m>(simd_, P, c, L, white);
    guard(P, before);
    return correction;
  }

#if VESTIBULE_HAS_AVX2_KERNELS
  VESTIBULE_AVX2 static void predictAvx2(StateMatrix& P, const Transition& step) {
    predictWith<planar>(P, step);
  }
  template <int m>
  VESTIBULE_AVX2 static Error updateAvx2(
      StateMatrix& P,
      const Correlation& c,
      const Eigen::Matrix<double, m, m>& L,
      const std::array<double, m>& white) {
    return updateWith<planar, m>(P, c, L, white);
  }
#endif
  static void predictIn([[maybe_unused]] Simd simd, StateMatrix& P, const Transition& step) {
#if VESTIBULE_HAS_AVX2_KERNELS
    if (simd == Simd::kAvx2) return predictAvx2(P, step);
#endif
    predictWith<planar>(P, step);
  }
  template <int m>
  static Error updateIn(
      [[maybe_unused]] Simd simd,
      StateMatrix& P,
      const Correlation& c,
      const Eigen::Matrix<double, m, m>& L,
      const std::array<double, m>& white) {
#if VESTIBULE_HAS_AVX2_KERNELS
    if (simd == Simd::kAvx2) return updateAvx2<m>(P, c, L, white);
#endif
    return updateWith<planar, m>(P, c, L, white);
  }

  Simd simd_;
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

std::unique_ptr<const Engine> makeFixedEngine(bool planar, Simd simd) {
  if (planar) return std::make_unique<FixedEngine<true>>(simd);
  return std::make_unique<FixedEngine<false>>(simd);
}

}  // namespace vestibule::ekf
