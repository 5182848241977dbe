#include "vestibule/sim/sensor_rate.hpp"

#include <cmath>

namespace vestibule::sim {

void rateField(ParamIo& io, double& rate_hz) {
  const double truth_hz = 1.0 / toSeconds(kTruthStep);
  io.optional("rate_hz", rate_hz, within(0.1, truth_hz));
  const double steps = truth_hz / rate_hz;
  if (std::abs(steps - std::round(steps)) > 1e-9) {
    io.problem("rate_hz", "must divide 200 Hz, e.g. 5, 10, 20, 50, 100");
  }
}

bool due(std::uint64_t step, double rate_hz) {
  const double steps = 1.0 / (rate_hz * toSeconds(kTruthStep));
  return step % static_cast<std::uint64_t>(std::llround(steps)) == 0;
}

}  // namespace vestibule::sim
