#include "vestibule/core/random.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace vestibule {
namespace {

TEST(Random, PhiloxMatchesThePublishedKnownAnswers) {
  // Known-answer vectors of philox4x32-10 distributed with the paper's reference implementation.
  const auto zero = philox4x32({0, 0, 0, 0}, {0, 0});
  EXPECT_EQ(
      zero, (std::array<std::uint32_t, 4>{0x6627e8d5U, 0xe169c58dU, 0xbc57ac4cU, 0x9b00dbd8U}));
  constexpr std::uint32_t kOnes = 0xffffffffU;
  const auto ones = philox4x32({kOnes, kOnes, kOnes, kOnes}, {kOnes, kOnes});
  EXPECT_EQ(
      ones, (std::array<std::uint32_t, 4>{0x408f276dU, 0x41c83b0eU, 0xa20bc7c6U, 0x6d5451fdU}));
}

TEST(Random, AStreamIsItsNameAndNothingElse) {
  RandomStream a(7, "gnss", 3);
  RandomStream other(7, "imu", 3);
  RandomStream b(7, "gnss", 3);
  for (int i = 0; i < 10; ++i) {
    other.normal();
    EXPECT_EQ(a.normal(), b.normal());
  }
  std::set<std::uint32_t> first;
  for (std::uint64_t seed : {7ULL, 8ULL}) {
    for (const char* name : {"gnss", "imu"}) {
      for (std::uint64_t index : {0ULL, 1ULL}) first.insert(RandomStream(seed, name, index)());
    }
  }
  EXPECT_EQ(first.size(), 8U);
}

TEST(Random, MomentsAreThoseOfTheDistributions) {
  // 1e5 draws: the standard error of the mean is 0.003, of the variance 0.0045; limits are 5 sigma.
  RandomStream rng(11, "moments");
  constexpr int kDraws = 100000;
  double sum = 0.0;
  double squares = 0.0;
  double uniform_sum = 0.0;
  double exponential_sum = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double n = rng.normal();
    sum += n;
    squares += n * n;
    const double u = rng.uniform();
    ASSERT_GE(u, 0.0);
    ASSERT_LT(u, 1.0);
    uniform_sum += u;
    exponential_sum += rng.exponential(2.0);
  }
  EXPECT_NEAR(sum / kDraws, 0.0, 0.016);
  EXPECT_NEAR(squares / kDraws, 1.0, 0.023);
  EXPECT_NEAR(uniform_sum / kDraws, 0.5, 0.005);
  EXPECT_NEAR(exponential_sum / kDraws, 2.0, 0.032);
}

}  // namespace
}  // namespace vestibule
