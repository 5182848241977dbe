#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "sequence_target.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string fault = vestibule::ekf::fuzz::feedSequence(data, size);
  if (!fault.empty()) {
    std::fprintf(stderr, "%s\n", fault.c_str());
    std::abort();
  }
  return 0;
}
