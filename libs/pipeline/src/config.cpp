#include "vestibule/pipeline/config.hpp"

namespace vestibule::pipeline {

void describe(ParamIo& io, Config& config) {
  io.optional("seed", config.seed);
  io.section("rig", config.rig);
  io.section("ekf", config.ekf);
  io.section("amcl", config.amcl);
  io.section("mode_manager", config.mode_manager);
  io.section("mission", config.mission);
  io.section("driver", config.driver);
  io.section("mapping", config.mapping);
  io.section("slice", config.slice);
}

Config loadConfig(const std::string& path) {
  return path.empty() ? Config{} : loadParams<Config>(path);
}

}  // namespace vestibule::pipeline
