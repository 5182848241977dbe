#include <cstddef>
#include <cstdint>
#include <string>

#include "session_target.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  vestibule::tuning::fuzz::readSession(bytes);
  vestibule::tuning::fuzz::readSuite(bytes);
  return 0;
}
