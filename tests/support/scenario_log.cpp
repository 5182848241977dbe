#include "scenario_log.hpp"

#include "test_files.hpp"
#include "vestibule/io/rawlog_writer.hpp"

namespace vestibule::test {

sim::Scenario shippedScenario(const std::string& name) {
  return sim::loadScenario(name, shipped("config/scenarios"));
}

metrics::Trajectory driveScenario(
    const sim::Scenario& scenario,
    std::uint64_t seed,
    const std::function<void(const Measurement&)>& measurement) {
  constexpr Duration kTick = std::chrono::milliseconds(20);
  sim::ScenarioRun run(scenario, seed);
  metrics::Trajectory truth;
  truth.push_back({run.simulator().time(), run.simulator().truth()});
  while (!run.finished()) {
    const auto arrived = run.step(kTick);
    truth.push_back({run.simulator().time(), run.simulator().truth()});
    for (const sim::Delivered& delivered : arrived) {
      if (measurement) measurement(delivered.measurement);
    }
  }
  return truth;
}

metrics::Trajectory recordScenario(
    const sim::Scenario& scenario, std::uint64_t seed, const std::string& rawlog_path) {
  io::RawlogWriter recording(rawlog_path);
  const metrics::Trajectory truth = driveScenario(
      scenario, seed, [&](const Measurement& m) { recording.write(m, io::labelOf(m)); });
  recording.close();
  return truth;
}

}  // namespace vestibule::test
