#include "vestibule/pipeline/config.hpp"

#include <cmath>
#include <vector>

namespace vestibule::pipeline {

void describe(ParamIo& io, DatumParams& params) {
  std::vector<double> position;
  if (params.position) {
    position = {params.position->lat_deg, params.position->lon_deg, params.position->height_m};
  }
  io.optional("position", position, 0, 3);
  if (position.size() == 3 && std::abs(position[0]) <= 90.0 && std::abs(position[1]) <= 180.0) {
    params.position = Geodetic{position[0], position[1], position[2]};
  } else if (!position.empty()) {
    io.problem("position", "must be [lat_deg, lon_deg, height_m] on Earth, or [] for the mean fix");
  }
  io.optional("average_s", params.average_s, nonNegative());
}

void describe(ParamIo& io, MapsParams& params) {
  io.optional("load_within_m", params.load_within_m, nonNegative());
  io.optional("unload_beyond_m", params.unload_beyond_m, positive());
  if (params.unload_beyond_m <= params.load_within_m) {
    io.problem("unload_beyond_m", "must be greater than load_within_m");
  }
}

void describe(ParamIo& io, Config& config) {
  io.optional("seed", config.seed);
  io.section("rig", config.rig);
  io.section("datum", config.datum);
  io.section("ekf", config.ekf);
  io.section("amcl", config.amcl);
  io.section("maps", config.maps);
  io.section("mode_manager", config.mode_manager);
  if (config.maps.load_within_m < config.mode_manager.zones.seed_within_m) {
    io.problem("maps", "load_within_m must not be less than mode_manager.zones.seed_within_m");
  }
  io.section("mission", config.mission);
  io.section("driver", config.driver);
  io.section("mapping", config.mapping);
  io.section("slice", config.slice);
}

Config loadConfig(const std::string& path) {
  return path.empty() ? Config{} : loadParams<Config>(path);
}

}  // namespace vestibule::pipeline
