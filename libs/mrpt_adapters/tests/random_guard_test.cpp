#include "vestibule/mrpt_adapters/random_guard.hpp"

#include <gtest/gtest.h>
#include <mrpt/random/RandomGenerators.h>

#include <cstdint>
#include <thread>
#include <vector>

namespace vestibule::mrpt_adapters {
namespace {

std::vector<std::uint32_t> draw(std::uint64_t seed) {
  seedMrptGenerator(seed);
  std::vector<std::uint32_t> values;
  for (int i = 0; i < 5; ++i) {
    values.push_back(mrpt::random::getRandomGenerator().drawUniform32bit());
  }
  return values;
}

TEST(RandomGuard, SameSeedSameNumbersWhateverWasDrawnBefore) {
  const auto first = draw(7);
  mrpt::random::getRandomGenerator().drawGaussian1D_normalized();
  EXPECT_EQ(draw(7), first);
}

TEST(RandomGuard, AllSixtyFourBitsOfTheSeedCount) {
  EXPECT_NE(draw(7), draw(8));
  EXPECT_NE(draw(7), draw(7 + (std::uint64_t{1} << 40U)));
}

TEST(RandomGuard, SeedsTheCallingThread) {
  const auto here = draw(3);
  std::vector<std::uint32_t> there;
  std::thread([&] { there = draw(3); }).join();
  EXPECT_EQ(there, here);
}

}  // namespace
}  // namespace vestibule::mrpt_adapters
