#pragma once

#include <cstdint>
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

/// What --config sets; config/default.yaml lists every key with its default.
struct Config {
  std::uint64_t seed = 1;
  SensorRig rig;
  ekf::FilterParams ekf;
  amcl::AmclParams amcl;
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
