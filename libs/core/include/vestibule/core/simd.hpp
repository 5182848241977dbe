#pragma once

/// For loops that are written once in plain C++ and compiled twice, for any machine and for AVX2:
/// mark the loop VESTIBULE_INLINE and call it from a function marked VESTIBULE_AVX2 as well.
/// Neither contracts a * b + c, so that both give the same bits as long as a loop sums nothing up
/// across its lanes.
#if defined(__x86_64__)
#define VESTIBULE_HAS_AVX2_KERNELS 1
#define VESTIBULE_AVX2 __attribute__((target("avx2")))
#else
#define VESTIBULE_HAS_AVX2_KERNELS 0
#endif
#define VESTIBULE_INLINE inline __attribute__((always_inline))

namespace vestibule {

enum class Simd { kPortable, kAvx2 };

/// What this machine can do.
[[nodiscard]] inline Simd bestSimd() {
#if VESTIBULE_HAS_AVX2_KERNELS
  static const bool has_avx2 = __builtin_cpu_supports("avx2") != 0;
  if (has_avx2) return Simd::kAvx2;
#endif
  return Simd::kPortable;
}

}  // namespace vestibule
