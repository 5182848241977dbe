#include <cstddef>
#include <cstdint>

#include "session_target.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  vestibule::tuning::fuzz::readSession({reinterpret_cast<const char*>(data), size});
  return 0;
}
