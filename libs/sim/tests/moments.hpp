#pragma once

#include <cmath>

namespace vestibule::sim {

struct Moments {
  int n = 0;
  double sum = 0.0;
  double sum2 = 0.0;
  void add(double v) {
    ++n;
    sum += v;
    sum2 += v * v;
  }
  [[nodiscard]] double mean() const { return sum / n; }
  [[nodiscard]] double sigma() const { return std::sqrt(sum2 / n - mean() * mean()); }
  [[nodiscard]] double rms() const { return std::sqrt(sum2 / n); }
};

}  // namespace vestibule::sim
