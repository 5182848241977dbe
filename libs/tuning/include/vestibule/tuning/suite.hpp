#pragma once

#include <string>
#include <vector>

#include "vestibule/tuning/engine.hpp"
#include "vestibule/tuning/journal.hpp"
#include "vestibule/tuning/session.hpp"
#include "vestibule/tuning/subject.hpp"
#include "vestibule/tuning/workers.hpp"

namespace vestibule::tuning {

/// A number of the configuration and the values it shall take.
struct Factor {
  std::string name;
  std::vector<double> values;
  SourceRef where;
};

/// A configuration file beside others.
struct NamedConfig {
  std::string name;
  std::string file;  ///< empty: the defaults
};

/// What is compared: a configuration file with a value for every factor.
struct Variant {
  std::string name;            ///< "particles=10 update_d_m=0.2"; unlike those of the others
  std::vector<double> levels;  ///< of the factors
  pipeline::Config config;
};

/// A table to be measured: every variant on every recording with every seed. File format:
/// docs/tuning.md.
struct Suite {
  std::string path;
  /// Subject, objectives, block_s and seeds; its training recordings are those of the suite, its
  /// base is the first of the configurations.
  Session runs;
  std::vector<NamedConfig> configs;  ///< at least one
  std::vector<Factor> factors;
  std::vector<Variant> variants;  ///< every combination, the last factor changing first
  int threads = 0;                ///< 0 = one per core; the table does not depend on it
};

/// Throws ConfigError with file:line of every problem.
/// \param scenario_folder where scenario names are looked up
[[nodiscard]] Suite loadSuite(const std::string& path, const std::string& scenario_folder);
[[nodiscard]] Suite parseSuite(
    const std::string& yaml, const std::string& name, const std::string& scenario_folder);

/// The configurations of the tasks runSuite() hands out. \pre the suite outlives it
[[nodiscard]] ConfigOf configOfVariant(const Suite& suite);

struct SuiteRun {
  std::size_t variant = 0;
  Case run;
  Outcome outcome;
  std::string folder;  ///< where its trajectory and map are; empty when none were asked for
};

struct SuiteResult {
  std::vector<SuiteRun> runs;  ///< by variant, recording, seed
  bool stopped_early = false;  ///< those that were not done are missing
};

/// Does what the journal does not know yet.
/// \param folder  for trajectories and maps, one folder per run; empty = they are not kept
[[nodiscard]] SuiteResult runSuite(
    const Suite& suite,
    const Subject& subject,
    Workers& workers,
    Journal& journal,
    const std::string& folder,
    const Callbacks& callbacks);

/// Of one objective in one run: mean over its blocks. NaN when there is no number.
[[nodiscard]] double meanScore(const Outcome& outcome, std::size_t objective);

/// What makes two suites the same, for the journal.
[[nodiscard]] std::string fingerprintOf(const Suite& suite);

}  // namespace vestibule::tuning
