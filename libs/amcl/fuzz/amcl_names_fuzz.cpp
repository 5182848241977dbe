#include <cstddef>
#include <cstdint>

#include "amcl_names_target.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  vestibule::amcl::fuzz::readAmclNames({reinterpret_cast<const char*>(data), size});
  return 0;
}
