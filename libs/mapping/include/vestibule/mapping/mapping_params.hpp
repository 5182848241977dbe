#pragma once

#include "vestibule/mapping/finish.hpp"
#include "vestibule/mapping/gmapping_names.hpp"
#include "vestibule/mapping/known_poses_mapper.hpp"
#include "vestibule/mapping/params.hpp"

namespace vestibule::mapping {

/// The section `mapping` of the configuration.
struct MappingParams {
  KnownPosesParams known_poses;  ///< its keys stand at the top of the section
  FilterParams filter;
  SmoothParams smooth;     ///< of every drive that is mapped anew
  FinishParams finish;     ///< of --finish
  GmappingNames gmapping;  ///< what it names is written into `filter`
};
void describe(ParamIo& io, MappingParams& params);

}  // namespace vestibule::mapping
