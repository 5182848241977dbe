// What a tuning session costs per candidate: the filter over the shipped Husky recording (395 s of
// GNSS, IMU and wheels, read once), and the session itself around a candidate that costs nothing.

#include <benchmark/benchmark.h>

#include "vestibule/tuning/engine.hpp"
#include "vestibule/tuning/subjects.hpp"

namespace vestibule::tuning {
namespace {

Session huskySession(const std::string& measure) {
  const std::string log = VESTIBULE_SOURCE_DIR "/datasets/husky_gnss/test1.bag";
  return parseSession(
      "parameters:\n  - {name: ekf.gyro.noise_rad_sqrt_s, from: 0.0002, to: 0.02}\n"
      "recordings:\n  training:\n    - {log: " +
          log + ", blocks: even}\n  validation:\n    - {log: " + log +
          ", blocks: odd}\nblock_s: 20\nobjectives:\n  - {measure: " + measure +
          ", length_s: 15}\n",
      "bench",
      VESTIBULE_SOURCE_DIR "/config/scenarios");
}

/// Items per second are candidates per second of one core.
void huskyCandidate(benchmark::State& state, const std::string& measure) {
  const Session session = huskySession(measure);
  const SearchSpace space(session.parameters, ParameterTree(session.base));
  const auto subject = makeSubject(session, {}, [](double, double) {});
  const TaskRunner runner(configOfCandidate(session, space), *subject);
  Task task{space.defaults(), Role::kTraining, {0, 1}, {}};
  for (auto _ : state) {
    task.values[0] *= 1.0001;
    const Outcome outcome = runner.run(task);
    if (!outcome.failure.empty()) state.SkipWithError(outcome.failure.c_str());
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK_CAPTURE(huskyCandidate, innovations, "innovation_likelihood")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(huskyCandidate, hidden_outage, "hidden_outage")->Unit(benchmark::kMillisecond);

/// Scores of ten blocks as soon as they are asked for.
class Nothing : public Subject {
 public:
  [[nodiscard]] std::size_t drives(Role role) const override {
    return role == Role::kFinal ? 0 : 1;
  }
  [[nodiscard]] std::string name(Role, std::size_t) const override { return "nothing"; }
  [[nodiscard]] double seconds(Role, std::size_t) const override { return 1.0; }
  [[nodiscard]] bool random() const override { return true; }
  [[nodiscard]] Outcome run(
      const pipeline::Config& config,
      Role,
      std::size_t,
      std::uint64_t seed,
      const std::string&) const override {
    Outcome outcome;
    outcome.objectives.emplace_back();
    for (int block = 0; block < 10; ++block) {
      outcome.objectives[0].push_back(
          {block, 1.0 + config.ekf.gyro.noise_rad_sqrt_s + 0.01 * static_cast<double>(seed % 7)});
    }
    return outcome;
  }
  [[nodiscard]] Paths paths(const pipeline::Config&, Role, std::size_t) const override {
    return {};
  }
};

/// A whole session of 200 candidates: items per second are candidates per second.
void sessionAroundNothing(benchmark::State& state) {
  Session session = huskySession("hidden_outage");
  session.seeds.count = 1;
  const SearchSpace space(session.parameters, ParameterTree(session.base));
  const Nothing subject;
  const TaskRunner runner(configOfCandidate(session, space), subject);
  std::int64_t candidates = 0;
  for (auto _ : state) {
    ThreadWorkers workers(runner, 1);
    Journal journal("", "");
    candidates +=
        static_cast<std::int64_t>(tune(session, space, subject, workers, journal, {}).tried.size());
  }
  state.SetItemsProcessed(candidates);
}
BENCHMARK(sessionAroundNothing)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

}  // namespace
}  // namespace vestibule::tuning

BENCHMARK_MAIN();
