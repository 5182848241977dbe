#pragma once

#include <cstdint>

namespace vestibule::mrpt_adapters {

/// Seeds MRPT's generator of the calling thread (it is thread-local and otherwise seeds itself from
/// the clock). Call it right before MRPT code that draws, with a derivedSeed() of its own, so that
/// the result does not depend on what drew before.
void seedMrptGenerator(std::uint64_t seed);

}  // namespace vestibule::mrpt_adapters
