#pragma once

#include <functional>

namespace vestibule::pipeline {

/// Told now and then how far a run is: share done in [0, 1] (negative = unknown) and the data time
/// handled so far [s]. May throw to end the run early.
using Progress = std::function<void(double share, double data_s)>;

}  // namespace vestibule::pipeline
