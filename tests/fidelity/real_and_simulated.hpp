#pragma once

#include <optional>
#include <string>
#include <vector>

#include "histogram_picture.hpp"

namespace vestibule::test {

/// Normalised innovations of the fixes, sqrt(n' S^-1 n), whatever became of the fix, when the
/// GNSS/IMU/wheel filter runs over a recording.
[[nodiscard]] std::vector<double> gnssInnovations(
    const std::string& recording, const std::string& csv_mapping = {});

/// What map localization sees of a recording.
struct ScanFit {
  std::vector<double> residuals_m;     ///< of beam ends to the nearest mapped obstacle
  std::vector<double> outlier_shares;  ///< of a scan's beams
};

/// Every comparison whose recordings are there. `data_folder`: recordings that are not shipped.
[[nodiscard]] std::vector<Panel> comparisons(const std::optional<std::string>& data_folder);

}  // namespace vestibule::test
