#include "vestibule/tuning/engine.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "drive_list.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/tuning/search.hpp"

namespace vestibule::tuning {
namespace {

constexpr std::size_t kWinners = 5;         // scored again with fresh seeds
constexpr std::uint64_t kFreshFrom = 1000;  // fresh seeds begin so far behind the others
constexpr std::size_t kFewestCorrelated = 8;
// Parameters are changed to these multiples of the winner's value, as far as the range goes.
constexpr double kSliceFactors[] = {0.5, 0.71, 0.87, 1.15, 1.41, 2.0};

/// Runs of one role, under the name the journal knows them by.
struct RunSet {
  std::string name;
  Role role;
  std::vector<Case> cases;
};

class Engine {
 public:
  Engine(
      const Session& session,
      const SearchSpace& space,
      const Subject& subject,
      Workers& workers,
      Journal& journal,
      const Callbacks& callbacks)
      : session_(session),
        space_(space),
        subject_(subject),
        workers_(workers),
        journal_(journal),
        callbacks_(callbacks),
        training_(runSet("training", Role::kTraining, false)),
        validation_(runSet("validation", Role::kValidation, true)),
        final_(runSet("final", Role::kFinal, true)) {}

  TuningResult run() {
    result_.resumed = journal_.resumed();
    result_.defaults = space_.defaults();
    runDefaults();
    search();
    chooseWinner();
    validate();
    leaveOneOut();
    if (session_.search.slices && result_.winner != result_.defaults) slice();
    correlate();
    judge();
    return std::move(result_);
  }

 private:
  RunSet runSet(const std::string& name, Role role, bool fresh) const {
    RunSet set{name, role, {}};
    const int seeds = !subject_.random() ? 1 : fresh ? session_.seeds.fresh : session_.seeds.count;
    const std::uint64_t first =
        session_.seeds.first + (fresh && subject_.random() ? kFreshFrom : 0);
    for (std::size_t d = 0; d < subject_.drives(role); ++d) {
      for (int s = 0; s < seeds; ++s)
        set.cases.push_back({d, first + static_cast<std::uint64_t>(s)});
    }
    return set;
  }

  /// Every candidate on all runs of the set; what the journal knows is not run again.
  std::vector<Evaluation> evaluate(
      const RunSet& set, const std::vector<std::vector<double>>& candidates) {
    std::vector<std::vector<double>> fresh;
    for (const auto& values : candidates) {
      const bool known = journal_.find(set.name, values) != nullptr;
      if (!known && std::find(fresh.begin(), fresh.end(), values) == fresh.end()) {
        fresh.push_back(values);
      }
    }
    std::vector<Task> tasks;
    for (const auto& values : fresh) {
      for (const Case& c : set.cases) tasks.push_back({values, set.role, c, {}});
    }
    Evaluation e;
    workers_.run(tasks, callbacks_.heartbeat, [&](std::size_t i, const Outcome& outcome) {
      if (e.outcomes.empty()) e = {tasks[i].values, set.cases, {}};
      e.outcomes.push_back(outcome);
      if (e.outcomes.size() < set.cases.size()) return;
      const Evaluation* defaults = journal_.find(set.name, result_.defaults);
      const double cost =
          defaults == nullptr ? 1.0 : relativeCost(session_.objectives, *defaults, e);
      journal_.append(set.name, e, cost);
      e.outcomes.clear();
    });
    std::vector<Evaluation> all;
    for (const auto& values : candidates) all.push_back(*journal_.find(set.name, values));
    status_.done += candidates.size();
    callbacks_.status(status_);
    return all;
  }

  const Evaluation& known(const RunSet& set, const std::vector<double>& values) const {
    return *journal_.find(set.name, values);
  }

  /// The defaults on all that will be compared: what a recording cannot give is known before the
  /// search. Throws InputError with every problem.
  void runDefaults() {
    std::vector<const RunSet*> sets{&training_, &validation_};
    if (!final_.cases.empty()) sets.push_back(&final_);
    begin("defaults", sets.size());
    std::string problems;
    for (const RunSet* set : sets) {
      (void)evaluate(*set, {result_.defaults});
      for (std::size_t drive = 0; drive < subject_.drives(set->role); ++drive) {
        const std::string text = problemOf(part(known(*set, result_.defaults), drive, true));
        if (text.empty()) continue;
        problems += (problems.empty() ? "" : "\n") + placeOf(set->role, drive) +
                    subject_.name(set->role, drive) + ": the defaults " + text;
      }
    }
    if (!problems.empty()) throw InputError(problems);
  }

  /// Why the defaults' runs of a drive are none to compare with; empty when they are.
  std::string problemOf(const Evaluation& defaults) const {
    const std::string failure = defaults.failure();
    if (!failure.empty()) return "cannot be run: " + failure;
    for (std::size_t o = 0; o < session_.objectives.size(); ++o) {
      const auto has_number = [o](const Outcome& outcome) {
        return o < outcome.objectives.size() && !outcome.objectives[o].empty();
      };
      if (std::any_of(defaults.outcomes.begin(), defaults.outcomes.end(), has_number)) continue;
      return "give no number of " + std::string(toString(session_.objectives[o].measure)) +
             " to compare with (recording too short, no fixes in the windows, no reference?)";
    }
    return "";
  }

  /// "session.yaml:7: recordings.training: ".
  std::string placeOf(Role role, std::size_t drive) const {
    const std::vector<DriveSpec> drives = drivesOf(session_, role);
    const std::string where =
        drive < drives.size() ? drives[drive].recording->where.text() : session_.path;
    return where + ": recordings." + std::string(toString(role)) + ": ";
  }

  double cost(const RunSet& set, const std::vector<double>& values) const {
    return relativeCost(session_.objectives, known(set, result_.defaults), known(set, values));
  }

  void begin(const std::string& stage, std::size_t planned) {
    status_.stage = stage;
    status_.done = 0;
    status_.planned = planned;
  }

  void search() {
    const auto started = std::chrono::steady_clock::now();
    const auto out_of_time = [&] {
      const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - started;
      return session_.search.wall_s > 0.0 && wall.count() > session_.search.wall_s;
    };
    const bool smooth =
        std::all_of(session_.objectives.begin(), session_.objectives.end(), [](const Objective& o) {
          return o.measure == Measure::kInnovation;
        });
    Search search(
        session_.search,
        space_.cube(result_.defaults),
        smooth && !subject_.random(),
        session_.seeds.first);
    result_.algorithms = search.algorithms();
    begin("search", static_cast<std::size_t>(session_.search.evaluations));
    for (auto points = search.ask(); !points.empty(); points = search.ask()) {
      std::vector<std::vector<double>> candidates;
      for (const auto& point : points) candidates.push_back(space_.values(point));
      const std::vector<Evaluation> evaluations = evaluate(training_, candidates);
      std::vector<double> costs;
      for (const Evaluation& e : evaluations) {
        const std::string failure = whyNotComparable(known(training_, result_.defaults), e);
        costs.push_back(cost(training_, e.values));
        result_.tried.push_back({e.values, costs.back(), failure});
        result_.failures += failure.empty() ? 0U : 1U;
        status_.best = std::min(status_.best, costs.back());
      }
      search.tell(costs);
      if (callbacks_.stop() || out_of_time()) {
        result_.stopped_early = true;
        break;
      }
    }
  }

  /// The best candidates that are apart from each other.
  std::vector<std::vector<double>> best(std::size_t n) const {
    std::vector<const Candidate*> order;
    for (const Candidate& c : result_.tried) {
      if (c.failure.empty()) order.push_back(&c);
    }
    std::stable_sort(order.begin(), order.end(), [](const Candidate* a, const Candidate* b) {
      return a->cost < b->cost;
    });
    std::vector<std::vector<double>> chosen;
    for (const Candidate* c : order) {
      const auto point = space_.cube(c->values);
      const bool apart = std::all_of(chosen.begin(), chosen.end(), [&](const auto& values) {
        return distanceInCube(space_.cube(values), point) > kApart;
      });
      if (apart) chosen.push_back(c->values);
      if (chosen.size() == n) break;
    }
    return chosen;
  }

  /// The least cost on seeds that the search has not seen: the best of many on the same seeds is
  /// partly the luckiest.
  void chooseWinner() {
    result_.winner = result_.defaults;
    std::vector<std::vector<double>> winners = best(subject_.random() ? kWinners : 1);
    if (winners.empty()) return;
    if (!subject_.random()) {
      if (cost(training_, winners.front()) < 1.0) result_.winner = winners.front();
    } else {
      const RunSet fresh = runSet("fresh", Role::kTraining, true);
      begin("winners on fresh seeds", winners.size() + 1);
      (void)evaluate(fresh, {result_.defaults});
      (void)evaluate(fresh, winners);
      double least = 1.0;
      for (const auto& values : winners) {
        const double c = cost(fresh, values);
        result_.rescored.push_back({values, cost(training_, values), c});
        if (c >= least) continue;
        least = c;
        result_.winner = values;
      }
    }
    (void)evaluate(training_, {result_.winner});
    result_.training = gain(training_);
  }

  Gain gain(const RunSet& set) const {
    return compare(
        session_.objectives,
        known(set, result_.defaults),
        known(set, result_.winner),
        session_.accept.confidence,
        session_.seeds.first);
  }

  void validate() {
    begin("validation", 2);
    (void)evaluate(validation_, {result_.defaults, result_.winner});
    result_.validation = gain(validation_);
    for (std::size_t o = 0; o < session_.objectives.size(); ++o) {
      const Measure m = session_.objectives[o].measure;
      result_.levels.push_back(
          {std::string(toString(m)),
           level(m, known(validation_, result_.defaults), o),
           level(m, known(validation_, result_.winner), o)});
    }
    if (final_.cases.empty()) return;
    begin("final set", 2);
    (void)evaluate(final_, {result_.defaults, result_.winner});
    result_.final = gain(final_);
  }

  /// The runs of one drive, or all but those.
  static Evaluation part(const Evaluation& whole, std::size_t drive, bool only) {
    Evaluation e{whole.values, {}, {}};
    for (std::size_t i = 0; i < whole.cases.size(); ++i) {
      if ((whole.cases[i].drive == drive) != only) continue;
      e.cases.push_back(whole.cases[i]);
      e.outcomes.push_back(whole.outcomes[i]);
    }
    return e;
  }

  /// For every training drive: what would the others have chosen among all that was tried, and what
  /// is that worth here?
  void leaveOneOut() {
    const std::size_t drives = subject_.drives(Role::kTraining);
    if (drives < 2) return;
    const Evaluation& defaults = known(training_, result_.defaults);
    for (std::size_t d = 0; d < drives; ++d) {
      const Evaluation others = part(defaults, d, false);
      std::vector<double> choice = result_.defaults;
      double least = 1.0;
      for (const Candidate& c : result_.tried) {
        if (!c.failure.empty()) continue;
        const double cost =
            relativeCost(session_.objectives, others, part(known(training_, c.values), d, false));
        if (cost >= least) continue;
        least = cost;
        choice = c.values;
      }
      LeftOut row;
      row.drive = subject_.name(Role::kTraining, d);
      row.cost_of_choice = least;
      row.gain = compare(
          session_.objectives,
          part(defaults, d, true),
          part(known(training_, choice), d, true),
          session_.accept.confidence,
          session_.seeds.first);
      result_.left_out.push_back(std::move(row));
    }
  }

  void slice() {
    std::vector<std::vector<double>> candidates;
    std::vector<std::size_t> of;
    for (std::size_t i = 0; i < space_.size(); ++i) {
      for (const double factor : kSliceFactors) {
        std::vector<double> values = result_.winner;
        values[i] *= factor;
        values = space_.values(space_.cube(values));
        if (values[i] == result_.winner[i]) continue;
        candidates.push_back(std::move(values));
        of.push_back(i);
      }
    }
    begin("sensitivity", candidates.size());
    (void)evaluate(training_, candidates);
    for (std::size_t i = 0; i < space_.size(); ++i) {
      Slice s;
      s.parameter = space_.parameters()[i].name;
      s.points.emplace_back(result_.winner[i], cost(training_, result_.winner));
      for (std::size_t k = 0; k < candidates.size(); ++k) {
        if (of[k] == i) s.points.emplace_back(candidates[k][i], cost(training_, candidates[k]));
      }
      std::sort(s.points.begin(), s.points.end());
      s.points.erase(std::unique(s.points.begin(), s.points.end()), s.points.end());
      result_.slices.push_back(std::move(s));
    }
  }

  /// Of the good candidates: two parameters that can stand in for each other vary together there.
  void correlate() {
    std::vector<const Candidate*> good;
    for (const Candidate& c : result_.tried) {
      if (c.failure.empty()) good.push_back(&c);
    }
    std::stable_sort(good.begin(), good.end(), [](const Candidate* a, const Candidate* b) {
      return a->cost < b->cost;
    });
    good.resize(std::min(good.size(), std::max(kFewestCorrelated, good.size() / 10)));
    if (good.size() < kFewestCorrelated) return;
    const std::size_t n = space_.size();
    std::vector<std::vector<double>> cube;
    for (const Candidate* c : good) cube.push_back(space_.cube(c->values));
    std::vector<double> mean(n, 0.0);
    for (const auto& p : cube) {
      for (std::size_t i = 0; i < n; ++i) mean[i] += p[i] / static_cast<double>(cube.size());
    }
    const auto covariance = [&](std::size_t i, std::size_t j) {
      double sum = 0.0;
      for (const auto& p : cube) sum += (p[i] - mean[i]) * (p[j] - mean[j]);
      return sum;
    };
    result_.correlations.assign(n, std::vector<double>(n, 0.0));
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        const double scale = std::sqrt(covariance(i, i) * covariance(j, j));
        result_.correlations[i][j] = i == j ? 1.0 : scale > 0.0 ? covariance(i, j) / scale : 0.0;
      }
    }
  }

  static std::string percent(double share) {
    return shortNumber(std::round(1000.0 * share) / 10.0);
  }

  static std::string text(const Gain& g, double confidence) {
    if (!g.failure.empty()) return "no gain (" + g.failure + ")";
    return "gain " + percent(g.gain) + " % (" + percent(confidence) + " % interval " +
           percent(g.low) + " to " + percent(g.high) + " %, " + std::to_string(g.blocks) +
           " blocks, p = " + shortNumber(std::round(1e4 * g.p_value) / 1e4) + ")";
  }

  void judge() {
    const Gain& g = result_.validation;
    const double confidence = session_.accept.confidence;
    std::string why;
    if (result_.winner == result_.defaults) {
      why = "no candidate was better than the defaults on the training data";
    } else if (!g.failure.empty()) {
      why = g.failure;
    } else if (g.blocks < kFewestBlocks) {
      why = "only " + std::to_string(g.blocks) + " blocks of validation data, at least " +
            std::to_string(kFewestBlocks) + " are needed (shorter block_s, more recordings)";
    } else if (!g.significant(confidence)) {
      why = "the gain may be chance";
    } else if (g.gain < session_.accept.gain) {
      why = "the gain is below " + percent(session_.accept.gain) + " %";
    } else if (result_.final && (!result_.final->failure.empty() || result_.final->high < 0.0)) {
      why = "the final set got worse";
    }
    result_.accepted = why.empty();
    result_.verdict = (result_.accepted ? "tuned: " : "keep the defaults: " + why + "; ") +
                      ("validation: " + text(g, confidence));
    if (result_.final) result_.verdict += "; final set: " + text(*result_.final, confidence);
  }

  const Session& session_;
  const SearchSpace& space_;
  const Subject& subject_;
  Workers& workers_;
  Journal& journal_;
  const Callbacks& callbacks_;
  RunSet training_;
  RunSet validation_;
  RunSet final_;
  Status status_;
  TuningResult result_;
};

}  // namespace

TuningResult tune(
    const Session& session,
    const SearchSpace& space,
    const Subject& subject,
    Workers& workers,
    Journal& journal,
    const Callbacks& callbacks) {
  return Engine(session, space, subject, workers, journal, callbacks).run();
}

std::string fingerprintOf(const Session& session) {
  Session same = session;
  // What changes the way but not the result.
  same.search.threads = 0;
  same.search.wall_s = 0.0;
  const std::string text = dumpParams(same) + dumpParams(session.base);
  char hex[24];
  std::snprintf(hex, sizeof hex, "%016llx", static_cast<unsigned long long>(derivedSeed(0, text)));
  return hex;
}

}  // namespace vestibule::tuning
