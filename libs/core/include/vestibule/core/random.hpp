#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string_view>

namespace vestibule {

/// Philox4x32-10: four 32-bit words out of a 128-bit counter and a 64-bit key, without state.
/// Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011.
[[nodiscard]] std::array<std::uint32_t, 4> philox4x32(
    std::array<std::uint32_t, 4> counter, std::array<std::uint32_t, 2> key);

/// A random stream named by (seed, name, index): the same three always give the same numbers, on
/// any machine and any thread, and no other stream's use disturbs it. Cheap to create: make one
/// per sensor and step, or per particle and step.
/// Satisfies UniformRandomBitGenerator. Copying copies the position.
class RandomStream {
 public:
  using result_type = std::uint32_t;

  RandomStream(std::uint64_t seed, std::string_view name, std::uint64_t index = 0);

  static constexpr result_type min() { return 0; }
  static constexpr result_type max() { return std::numeric_limits<result_type>::max(); }
  result_type operator()();

  /// Uniform in [0, 1), 53 random bits.
  double uniform();
  double uniform(double low, double high);
  /// Standard normal by Box-Muller; both values of a pair are used in order.
  double normal();
  double normal(double mean, double sigma);
  /// Exponential with the given mean.
  double exponential(double mean);
  bool bernoulli(double probability);

 private:
  std::array<std::uint32_t, 2> key_{};
  std::array<std::uint32_t, 4> counter_{};
  std::array<std::uint32_t, 4> block_{};
  unsigned next_word_ = 4;
  double spare_normal_ = 0.0;
  bool has_spare_normal_ = false;
};

/// One 64-bit hash of the three, for libraries that only take a seed.
[[nodiscard]] std::uint64_t derivedSeed(
    std::uint64_t seed, std::string_view name, std::uint64_t index = 0);

}  // namespace vestibule
