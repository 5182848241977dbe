#include "amcl_names_target.hpp"

#include "vestibule/amcl/amcl_names.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::amcl::fuzz {

void readAmclNames(const std::string& bytes) {
  AmclParams params;
  try {
    (void)applyAmclText(bytes, "fuzz.yaml", params);
  } catch (const ConfigError&) {
    // What was wrong was said.
  }
}

}  // namespace vestibule::amcl::fuzz
