#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/tuning/engine.hpp"

namespace vestibule::tuning::test {

/// What a parser says of a text that it refuses.
template <class Parse>
std::string complaintOf(const Parse& parse, const std::string& text) {
  try {
    (void)parse(text);
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "no complaint";
}

/// A subject whose scores are a formula of two tuned parameters.
class FormulaSubject : public Subject {
 public:
  /// Error [m] of a block: (gyro noise, wheel noise, random stream of the run and block).
  using Formula = std::function<double(double, double, RandomStream&)>;
  explicit FormulaSubject(Formula formula, int blocks = 12)
      : formula_(std::move(formula)), blocks_(blocks) {}

  [[nodiscard]] std::size_t drives(Role role) const override {
    return role == Role::kFinal ? 0 : 2;
  }
  [[nodiscard]] std::string name(Role role, std::size_t drive) const override {
    return std::string(toString(role)) + " " + std::to_string(drive);
  }
  [[nodiscard]] double seconds(Role, std::size_t) const override { return 60.0; }
  [[nodiscard]] bool random() const override { return true; }
  [[nodiscard]] Outcome run(
      const pipeline::Config& config,
      Role role,
      std::size_t drive,
      std::uint64_t seed,
      const std::string&) const override {
    const double gyro = config.ekf.gyro.noise_rad_sqrt_s;
    const double wheels = config.ekf.wheels.distance_sigma_sqrt_m;
    Outcome outcome;
    outcome.objectives.emplace_back();
    for (int block = 0; block < blocks_; ++block) {
      RandomStream random(
          derivedSeed(seed, std::string(toString(role)) + shortNumber(gyro) + shortNumber(wheels)),
          "formula",
          drive * 1000 + static_cast<std::uint64_t>(block));
      outcome.objectives.front().push_back({block, formula_(gyro, wheels, random)});
      if (!std::isfinite(outcome.objectives.front().back().value)) outcome.failure = "diverged";
    }
    return outcome;
  }
  [[nodiscard]] Paths paths(const pipeline::Config&, Role, std::size_t) const override {
    return {};
  }

 private:
  Formula formula_;
  int blocks_;
};

/// Best at gyro noise 5e-4 and wheel noise 0.2 (default 2e-3 and 0.05), with a little noise.
inline double bowl(double gyro, double wheels, RandomStream& random) {
  const double a = std::log10(gyro / 5e-4);
  const double b = std::log10(wheels / 0.2);
  return 1.0 + a * a + 0.5 * b * b + 0.3 * a * b + 0.01 * random.normal();
}

inline Session twoParameters() {
  Session session;
  session.path = "session.yaml";
  session.parameters = {
      {"ekf.gyro.noise_rad_sqrt_s", 2e-5, 2e-2, true, {}, {}},
      {"ekf.wheels.distance_sigma_sqrt_m", 5e-3, 1.0, true, {}, {}}};
  session.objectives = {Objective{Measure::kApe, 1.0, 30.0, 10.0, {}}};
  session.search.evaluations = 80;
  session.search.slices = false;
  session.seeds.count = 2;
  session.seeds.fresh = 3;
  return session;
}

inline TuningResult tuned(
    const Session& session,
    const Subject& subject,
    std::size_t threads = 1,
    const std::string& journal_path = "",
    const Callbacks& callbacks = {}) {
  const SearchSpace space(session.parameters, ParameterTree(session.base));
  const TaskRunner runner(configOfCandidate(session, space), subject, session.limits);
  ThreadWorkers workers(runner, threads);
  Journal journal(journal_path, fingerprintOf(session));
  return tune(session, space, subject, workers, journal, callbacks);
}

}  // namespace vestibule::tuning::test
