#include "vestibule/mrpt_adapters/random_guard.hpp"

#include <mrpt/random/RandomGenerators.h>

namespace vestibule::mrpt_adapters {

void seedMrptGenerator(std::uint64_t seed) {
  // MRPT's generator takes 32 bits: fold the upper half in, so that it counts as well.
  const std::uint64_t folded = seed ^ (seed >> 32U);
  mrpt::random::getRandomGenerator().randomize(static_cast<std::uint32_t>(folded));
}

}  // namespace vestibule::mrpt_adapters
