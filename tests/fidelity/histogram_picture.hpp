#pragma once

#include <string>
#include <vector>

namespace vestibule::test {

struct Sample {
  std::string name;
  std::vector<double> values;
  std::vector<double> medians = {};  ///< of the single drives, where there are several
};

/// Quantile by linear interpolation. \pre values is not empty; share in [0, 1]
[[nodiscard]] double quantile(std::vector<double> values, double share);

/// Shares of real and simulated values per bin, one over the other.
struct Panel {
  std::string title;
  std::string unit;
  double largest = 1.0;  ///< upper end of the axis; what lies beyond counts to the last bin
  int bins = 30;
  Sample real;
  Sample simulated;
};

/// Two panels a row. Throws std::runtime_error when the file cannot be written.
void drawPanels(const std::vector<Panel>& panels, const std::string& png_path);

}  // namespace vestibule::test
