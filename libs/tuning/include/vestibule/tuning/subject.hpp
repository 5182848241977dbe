#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "vestibule/metrics/trajectory.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/tuning/session.hpp"

namespace vestibule::tuning {

/// What an objective gives for one block of a recording.
struct Score {
  int block = 0;  ///< of the recording; kWholeRun where the run has but one number
  double value = 0.0;
};
inline constexpr int kWholeRun = -1;

/// What became of one run.
struct Outcome {
  std::vector<std::vector<Score>> objectives;  ///< in the order of the session
  std::string failure;  ///< why the run counts as failed; empty = it does not
  double cpu_s = 0.0;   ///< [s] of the machine that ran it; nothing else depends on it
};

/// What is tuned: runs that depend on a configuration. A run may be asked for from any thread and
/// gives the same outcome every time.
class Subject {
 public:
  Subject() = default;
  Subject(const Subject&) = delete;
  Subject& operator=(const Subject&) = delete;
  virtual ~Subject() = default;

  /// Drives of a role: one per recording, several per scenario.
  [[nodiscard]] virtual std::size_t drives(Role role) const = 0;
  [[nodiscard]] virtual std::string name(Role role, std::size_t drive) const = 0;
  /// Length of the recording [s].
  [[nodiscard]] virtual double seconds(Role role, std::size_t drive) const = 0;
  /// Whether the seed changes the outcome.
  [[nodiscard]] virtual bool random() const = 0;
  /// \param folder  where the run leaves its trajectory and map; empty = nowhere
  [[nodiscard]] virtual Outcome run(
      const pipeline::Config& config,
      Role role,
      std::size_t drive,
      std::uint64_t seed,
      const std::string& folder) const = 0;

  /// For the report; may be empty.
  struct Paths {
    metrics::Trajectory estimate;
    metrics::Trajectory reference;
  };
  [[nodiscard]] virtual Paths paths(
      const pipeline::Config& config, Role role, std::size_t drive) const = 0;
};

}  // namespace vestibule::tuning
