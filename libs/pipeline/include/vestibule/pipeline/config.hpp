#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "vestibule/amcl/params.hpp"
#include "vestibule/ekf/params.hpp"
#include "vestibule/mapping/mapping_params.hpp"
#include "vestibule/mode_manager/params.hpp"
#include "vestibule/mrpt_adapters/reactive_driver.hpp"
#include "vestibule/nav/mission_runner.hpp"
#include "vestibule/sensors/rig.hpp"
#include "vestibule/sensors/sweep_slice.hpp"

namespace vestibule::pipeline {

/// Origin of the map frame for recordings with geodetic fixes.
struct DatumParams {
  std::optional<Geodetic> position;  ///< empty: the mean of the first fixes
  double average_s = 10.0;           ///< [s] after the first fix
};
void describe(ParamIo& io, DatumParams& params);

/// When the indoor maps of a site are in memory, by the robot's distance to their rectangles.
struct MapsParams {
  double load_within_m = 50.0;
  double unload_beyond_m = 100.0;  ///< except for a map that is at work
};
void describe(ParamIo& io, MapsParams& params);

/// What --config sets; config/default.yaml lists every key with its default.
struct Config {
  std::uint64_t seed = 1;
  SensorRig rig;
  DatumParams datum;
  ekf::FilterParams ekf;
  amcl::AmclParams amcl;
  MapsParams maps;
  mode_manager::ModeManagerParams mode_manager;
  nav::MissionRunnerParams mission;
  mrpt_adapters::ReactiveParams driver;
  mapping::MappingParams mapping;
  SliceParams slice;  ///< of 3D sweeps, where they become scans
};
void describe(ParamIo& io, Config& config);

/// Defaults for an empty path.
[[nodiscard]] Config loadConfig(const std::string& path);

}  // namespace vestibule::pipeline
