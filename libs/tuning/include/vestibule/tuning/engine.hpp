#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/tuning/journal.hpp"
#include "vestibule/tuning/scoring.hpp"
#include "vestibule/tuning/search_space.hpp"
#include "vestibule/tuning/session.hpp"
#include "vestibule/tuning/subject.hpp"
#include "vestibule/tuning/workers.hpp"

namespace vestibule::tuning {

/// How far a session is, for people.
struct Status {
  std::string stage;        ///< "search", "winners on fresh seeds", ...
  std::size_t done = 0;     ///< candidates of this stage
  std::size_t planned = 0;  ///< 0 = unknown
  double best = 1.0;        ///< relative cost so far
};
struct Callbacks {
  std::function<void(const Status&)> status = [](const Status&) {};
  /// True once: the search ends and what it found is judged.
  std::function<bool()> stop = [] { return false; };
  /// While runs are being done; may throw to end everything at once.
  Heartbeat heartbeat = [] {};
};

/// One cut through the optimum: the training cost along one parameter, the others as tuned.
struct Slice {
  std::string parameter;
  std::vector<std::pair<double, double>> points;  ///< value, cost
};

/// Gain on one drive of a candidate chosen without it.
struct LeftOut {
  std::string drive;
  double cost_of_choice = 1.0;  ///< on the others
  Gain gain;                    ///< on this one
};

struct Candidate {
  std::vector<double> values;
  double cost = kPenalty;  ///< training, relative to the defaults
  std::string failure;
};

struct TuningResult {
  std::vector<double> defaults;
  std::vector<double> winner;    ///< the defaults themselves when nothing was better
  std::vector<Candidate> tried;  ///< of the search, in order
  std::string algorithms;
  bool stopped_early = false;
  std::size_t failures = 0;
  std::size_t resumed = 0;  ///< evaluations taken from the journal

  struct Rescored {
    std::vector<double> values;
    double training = 1.0;
    double fresh = 1.0;
  };
  std::vector<Rescored> rescored;  ///< the best, again with fresh seeds; empty without randomness
  Gain training;                   ///< with the seeds of the search
  Gain validation;
  std::optional<Gain> final;
  std::vector<LeftOut> left_out;
  std::vector<Slice> slices;
  /// Of the best tenth of what was tried, in the scale of the search; empty when too few.
  std::vector<std::vector<double>> correlations;
  /// Levels of each objective on the validation data.
  struct ObjectiveLevel {
    std::string measure;
    double before = 0.0;
    double after = 0.0;
  };
  std::vector<ObjectiveLevel> levels;

  bool accepted = false;
  std::string verdict;  ///< in words, with the figures
};

/// Runs a session to its end. Same session and recordings give the same result for any workers, and
/// whether it ran through or was killed and resumed.
/// Throws InputError when not even the defaults can be run.
[[nodiscard]] TuningResult tune(
    const Session& session,
    const SearchSpace& space,
    const Subject& subject,
    Workers& workers,
    Journal& journal,
    const Callbacks& callbacks);

/// What makes two sessions the same, for the journal.
[[nodiscard]] std::string fingerprintOf(const Session& session);

}  // namespace vestibule::tuning
