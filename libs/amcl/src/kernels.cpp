#include "kernels.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#if VESTIBULE_HAS_AVX2_KERNELS
#include <immintrin.h>
#endif

namespace vestibule::amcl {
namespace {

constexpr float kPiF = 3.14159265358979F;
constexpr float kLn2 = 0.693147180559945F;

// One block of lanes; loops over it have a constant length and become vector instructions.
using Floats = std::array<float, kLanes>;
using Words = std::array<std::uint32_t, kLanes>;

/// Philox4x32-10 (core/random.hpp) for kLanes consecutive counters at once.
VESTIBULE_INLINE void randomWords(
    std::size_t first, const NoiseKey& key, Words& a, Words& b, Words& c, Words& d) {
  for (std::size_t i = 0; i < kLanes; ++i) {
    a[i] = static_cast<std::uint32_t>(first + i);
    b[i] = key.purpose;
    c[i] = static_cast<std::uint32_t>(key.step);
    d[i] = static_cast<std::uint32_t>(key.step >> 32U);
  }
  std::uint32_t k0 = key.seed[0];
  std::uint32_t k1 = key.seed[1];
  for (int round = 0; round < 10; ++round) {
    for (std::size_t i = 0; i < kLanes; ++i) {
      const std::uint64_t p0 = 0xD2511F53ULL * a[i];
      const std::uint64_t p1 = 0xCD9E8D57ULL * c[i];
      a[i] = static_cast<std::uint32_t>(p1 >> 32U) ^ b[i] ^ k0;
      c[i] = static_cast<std::uint32_t>(p0 >> 32U) ^ d[i] ^ k1;
      b[i] = static_cast<std::uint32_t>(p1);
      d[i] = static_cast<std::uint32_t>(p0);
    }
    k0 += 0x9E3779B9U;
    k1 += 0xBB67AE85U;
  }
}

/// Sine and cosine of angles in [-2 pi, 2 pi]: quarter turns taken off, then Taylor series to
/// 2e-8. Written out because the library's differ from machine to machine and are slower.
VESTIBULE_INLINE void sineCosine(const Floats& angle, Floats& sine, Floats& cosine) {
  constexpr float kQuarterHigh = 1.5707963F;
  constexpr float kQuarterLow = 2.6794897e-8F;
  for (std::size_t i = 0; i < kLanes; ++i) {
    const float turns = angle[i] * (2.0F / kPiF);
    const auto quarter = static_cast<std::int32_t>(turns + (turns >= 0.0F ? 0.5F : -0.5F));
    const auto q = static_cast<float>(quarter);
    const float r = (angle[i] - q * kQuarterHigh) - q * kQuarterLow;
    const float r2 = r * r;
    const float s =
        r * (1.0F +
             r2 * (-1.0F / 6.0F + r2 * (1.0F / 120.0F + r2 * (-1.0F / 5040.0F + r2 / 362880.0F))));
    const float c =
        1.0F + r2 * (-0.5F + r2 * (1.0F / 24.0F + r2 * (-1.0F / 720.0F + r2 / 40320.0F)));
    const bool swap = (quarter & 1) != 0;
    const float sin_value = swap ? c : s;
    const float cos_value = swap ? s : c;
    sine[i] = (quarter & 2) != 0 ? -sin_value : sin_value;
    cosine[i] = ((quarter + 1) & 2) != 0 ? -cos_value : cos_value;
  }
}

/// Two standard normals per lane from two random words each (Box and Muller).
VESTIBULE_INLINE void normals(const Words& first, const Words& second, Floats& z0, Floats& z1) {
  Floats radius;
  for (std::size_t i = 0; i < kLanes; ++i) {
    // Uniform in (0, 1] with 24 bits, then its logarithm: exponent and 2 atanh((m - 1) / (m + 1)).
    const float u =
        static_cast<float>(static_cast<std::int32_t>((first[i] >> 8U) + 1U)) * (1.0F / 16777216.0F);
    std::uint32_t bits = 0;
    std::memcpy(&bits, &u, sizeof bits);
    // Mantissa in [sqrt(1/2), sqrt(2)): the offset moves the seam there.
    const std::uint32_t shifted = bits - 0x3F3504F3U;
    const auto exponent = static_cast<float>(static_cast<std::int32_t>(shifted) >> 23);
    const std::uint32_t mantissa_bits = (shifted & 0x007FFFFFU) + 0x3F3504F3U;
    float m = 0.0F;
    std::memcpy(&m, &mantissa_bits, sizeof m);
    const float t = (m - 1.0F) / (m + 1.0F);
    const float t2 = t * t;
    const float log_u =
        exponent * kLn2 +
        2.0F * t * (1.0F + t2 * (1.0F / 3.0F + t2 * (0.2F + t2 * (1.0F / 7.0F + t2 / 9.0F))));
    radius[i] = std::sqrt(std::max(0.0F, -2.0F * log_u));
  }
  Floats angle;
  for (std::size_t i = 0; i < kLanes; ++i) {
    angle[i] = static_cast<float>(static_cast<std::int32_t>(second[i])) * (kPiF / 2147483648.0F);
  }
  Floats s;
  Floats c;
  sineCosine(angle, s, c);
  for (std::size_t i = 0; i < kLanes; ++i) {
    z0[i] = radius[i] * c[i];
    z1[i] = radius[i] * s[i];
  }
}

VESTIBULE_INLINE void propagateBlocks(
    const ParticleArrays& p,
    std::size_t begin,
    std::size_t end,
    const NoisyIncrement& increment,
    const NoiseKey& key) {
  const auto& m = increment.mean;
  const auto& f = increment.factor;
  for (std::size_t first = begin; first < end; first += kLanes) {
    Words a;
    Words b;
    Words c;
    Words d;
    randomWords(first, key, a, b, c, d);
    Floats z0;
    Floats z1;
    Floats z2;
    Floats unused;
    normals(a, b, z0, z1);
    normals(c, d, z2, unused);
    Floats yaw;
    std::memcpy(yaw.data(), p.yaw + first, sizeof yaw);
    Floats sine;
    Floats cosine;
    sineCosine(yaw, sine, cosine);
    for (std::size_t i = 0; i < kLanes; ++i) {
      const float dx = m[0] + f[0] * z0[i];
      const float dy = m[1] + f[1] * z0[i] + f[2] * z1[i];
      const float turned = yaw[i] + m[2] + f[3] * z0[i] + f[4] * z1[i] + f[5] * z2[i];
      p.x[first + i] += cosine[i] * dx - sine[i] * dy;
      p.y[first + i] += sine[i] * dx + cosine[i] * dy;
      const float wrapped = turned >= kPiF ? turned - 2.0F * kPiF : turned;
      p.yaw[first + i] = wrapped < -kPiF ? wrapped + 2.0F * kPiF : wrapped;
    }
  }
}

void propagatePortable(
    const ParticleArrays& p,
    std::size_t begin,
    std::size_t end,
    const NoisyIncrement& increment,
    const NoiseKey& key) {
  propagateBlocks(p, begin, end, increment, key);
}

/// \pre inside: the point falls into the table
template <bool inside>
VESTIBULE_INLINE std::uint32_t valueAt(const TableView& t, std::int32_t x, std::int32_t y) {
  std::int32_t ix = x >> kFractionBits;
  std::int32_t iy = y >> kFractionBits;
  if (!inside) {
    ix = std::min(std::max(ix, 0), t.width - 1);
    iy = std::min(std::max(iy, 0), t.height - 1);
  }
  return t.values[iy * t.width + ix];
}

template <bool inside>
VESTIBULE_INLINE std::uint32_t sumOne(
    const TableView& t,
    const std::int32_t* bx,
    const std::int32_t* by,
    std::size_t begin,
    std::size_t end,
    std::int32_t x,
    std::int32_t y) {
  std::uint32_t sum = 0;
  for (std::size_t b = begin; b < end; ++b) sum += valueAt<inside>(t, x + bx[b], y + by[b]);
  return sum;
}

template <bool inside>
void sumPortable(
    const TableView& t,
    const std::int32_t* bx,
    const std::int32_t* by,
    std::size_t beams,
    const std::int32_t* x,
    const std::int32_t* y,
    std::size_t count,
    std::uint32_t* sum) {
  // Two positions at a time: each beam is loaded once for both.
  std::size_t k = 0;
  for (; k + 1 < count; k += 2) {
    const std::int32_t x0 = x[k];
    const std::int32_t y0 = y[k];
    const std::int32_t x1 = x[k + 1];
    const std::int32_t y1 = y[k + 1];
    std::uint32_t sum0 = 0;
    std::uint32_t sum1 = 0;
    for (std::size_t b = 0; b < beams; ++b) {
      sum0 += valueAt<inside>(t, x0 + bx[b], y0 + by[b]);
      sum1 += valueAt<inside>(t, x1 + bx[b], y1 + by[b]);
    }
    sum[k] += sum0;
    sum[k + 1] += sum1;
  }
  if (k < count) sum[k] += sumOne<inside>(t, bx, by, 0, beams, x[k], y[k]);
}

#if VESTIBULE_HAS_AVX2_KERNELS
VESTIBULE_AVX2 void propagateAvx2(
    const ParticleArrays& p,
    std::size_t begin,
    std::size_t end,
    const NoisyIncrement& increment,
    const NoiseKey& key) {
  propagateBlocks(p, begin, end, increment, key);
}

template <bool inside>
VESTIBULE_AVX2 void sumAvx2(
    const TableView& t,
    const std::int32_t* bx,
    const std::int32_t* by,
    std::size_t beams,
    const std::int32_t* x,
    const std::int32_t* y,
    std::size_t count,
    std::uint32_t* sum) {
  const __m256i width = _mm256_set1_epi32(t.width);
  const __m256i last_x = _mm256_set1_epi32(t.width - 1);
  const __m256i last_y = _mm256_set1_epi32(t.height - 1);
  const __m256i zero = _mm256_setzero_si256();
  const __m256i low_half = _mm256_set1_epi32(0xFFFF);
  const auto look = [&](__m256i px, __m256i py, std::size_t b) VESTIBULE_AVX2 {
    const __m256i beam_x = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(bx + b));
    const __m256i beam_y = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(by + b));
    __m256i ix = _mm256_srai_epi32(_mm256_add_epi32(px, beam_x), kFractionBits);
    __m256i iy = _mm256_srai_epi32(_mm256_add_epi32(py, beam_y), kFractionBits);
    if (!inside) {
      ix = _mm256_min_epi32(_mm256_max_epi32(ix, zero), last_x);
      iy = _mm256_min_epi32(_mm256_max_epi32(iy, zero), last_y);
    }
    const __m256i index = _mm256_add_epi32(_mm256_mullo_epi32(iy, width), ix);
    const __m256i pair = _mm256_i32gather_epi32(reinterpret_cast<const int*>(t.values), index, 2);
    return _mm256_and_si256(pair, low_half);
  };
  const std::size_t whole = beams / kLanes * kLanes;
  for (std::size_t k = 0; k < count; ++k) {
    const __m256i px = _mm256_set1_epi32(x[k]);
    const __m256i py = _mm256_set1_epi32(y[k]);
    __m256i total = zero;
    for (std::size_t b = 0; b < whole; b += kLanes)
      total = _mm256_add_epi32(total, look(px, py, b));
    __m128i half = _mm_add_epi32(_mm256_castsi256_si128(total), _mm256_extracti128_si256(total, 1));
    half = _mm_add_epi32(half, _mm_shuffle_epi32(half, 0x4E));
    half = _mm_add_epi32(half, _mm_shuffle_epi32(half, 0xB1));
    sum[k] += static_cast<std::uint32_t>(_mm_cvtsi128_si32(half)) +
              sumOne<inside>(t, bx, by, whole, beams, x[k], y[k]);
  }
}
#endif

}  // namespace

void propagate(
    const ParticleArrays& particles,
    std::size_t begin,
    std::size_t end,
    const NoisyIncrement& increment,
    const NoiseKey& key,
    [[maybe_unused]] Simd simd) {
#if VESTIBULE_HAS_AVX2_KERNELS
  if (simd == Simd::kAvx2) {
    propagateAvx2(particles, begin, end, increment, key);
    return;
  }
#endif
  propagatePortable(particles, begin, end, increment, key);
}

void sumOverBeams(
    const TableView& table,
    const std::int32_t* beam_x,
    const std::int32_t* beam_y,
    std::size_t beams,
    const std::int32_t* x,
    const std::int32_t* y,
    std::size_t count,
    bool inside,
    std::uint32_t* sum,
    [[maybe_unused]] Simd simd) {
#if VESTIBULE_HAS_AVX2_KERNELS
  if (simd == Simd::kAvx2) {
    (inside ? sumAvx2<true> : sumAvx2<false>)(table, beam_x, beam_y, beams, x, y, count, sum);
    return;
  }
#endif
  (inside ? sumPortable<true> : sumPortable<false>)(table, beam_x, beam_y, beams, x, y, count, sum);
}

}  // namespace vestibule::amcl
