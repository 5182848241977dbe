#include "session_target.hpp"

#include "vestibule/core/errors.hpp"
#include "vestibule/tuning/session.hpp"
#include "vestibule/tuning/suite.hpp"

namespace vestibule::tuning::fuzz {

void readSession(const std::string& bytes) {
  try {
    (void)parseSession(bytes, "fuzz.yaml", VESTIBULE_SOURCE_DIR "/config/scenarios");
  } catch (const ConfigError&) {
    // What was wrong was said.
  }
}

void readSuite(const std::string& bytes) {
  try {
    (void)parseSuite(bytes, "fuzz.yaml", VESTIBULE_SOURCE_DIR "/config/scenarios");
  } catch (const ConfigError&) {
    // What was wrong was said.
  }
}

}  // namespace vestibule::tuning::fuzz
