#include "vestibule/tuning/suite.hpp"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <limits>
#include <set>

#include "session_parts.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/tuning/parameter_tree.hpp"

namespace vestibule::tuning {
namespace {

constexpr std::size_t kMostValues = 1000;
constexpr std::size_t kMostVariants = 10000;

/// "mapping.filter.particles" -> "particles".
std::string lastPart(const std::string& name) { return name.substr(name.rfind('.') + 1); }

/// Fit for the name of a folder.
std::string slug(const std::string& name) {
  std::string text = name;
  for (char& c : text) {
    const auto u = static_cast<unsigned char>(c);
    if (std::isalnum(u) == 0 && c != '.' && c != '-') c = '_';
  }
  return text;
}

void checkFactors(Problems& problems, const Suite& suite) {
  const ParameterTree tree(suite.runs.base);
  std::set<std::string> seen;
  std::size_t variants = suite.configs.size();
  for (const Factor& f : suite.factors) {
    if (f.name.empty()) continue;
    std::string text = tree.whyNot(f.name);
    if (text.empty() && !seen.insert(f.name).second) text = "varied twice";
    if (!text.empty()) {
      problems.add(f.where, "factors", f.name + ": " + text);
      continue;
    }
    for (const double value : f.values) {
      try {
        (void)withValues(suite.runs.base, {{f.name, value}});
      } catch (const ConfigError& e) {
        const std::string what = e.what();  // "tuned values:3: ekf....: must be > 0"
        problems.add(
            f.where,
            "factors",
            "at " + shortNumber(value) + ": " + what.substr(what.find(' ', 13) + 1));
      }
    }
    variants *= std::max<std::size_t>(1, f.values.size());
    if (variants > kMostVariants) {
      problems.add(
          f.where, "factors", "more than " + std::to_string(kMostVariants) + " combinations");
      return;
    }
  }
}

/// Names of the configurations, each once.
void checkConfigs(ParamIo& io, Suite& suite) {
  std::set<std::string> names;
  for (const NamedConfig& c : suite.configs) {
    if (!c.name.empty() && !names.insert(c.name).second) {
      io.problem("configs", c.name + ": two configurations have this name");
    }
  }
}

/// Every combination of configurations and values.
std::vector<Variant> variantsOf(const Suite& suite, const std::vector<pipeline::Config>& configs) {
  std::vector<Variant> variants;
  for (std::size_t c = 0; c < configs.size(); ++c) {
    const bool one = suite.configs.size() == 1 && !suite.factors.empty();
    variants.push_back({one ? "" : suite.configs[c].name, {}, configs[c]});
  }
  for (const Factor& f : suite.factors) {
    std::vector<Variant> next;
    for (const Variant& v : variants) {
      for (const double value : f.values) {
        Variant with = v;
        with.name += (v.name.empty() ? "" : " ") + lastPart(f.name) + "=" + shortNumber(value);
        with.levels.push_back(value);
        with.config = withValues(v.config, {{f.name, value}});
        next.push_back(std::move(with));
      }
    }
    variants = std::move(next);
  }
  return variants;
}

}  // namespace

static void describe(ParamIo& io, Factor& f) {
  io.required("name", f.name);
  io.required("values", f.values, 1, kMostValues);
  if (!io.writing()) f.where = io.here("name");
}

static void describe(ParamIo& io, NamedConfig& c) {
  io.required("name", c.name);
  requireFile(io, "file", c.file);
}

static void describe(ParamIo& io, Suite& suite) {
  Session& runs = suite.runs;
  io.optional<SubjectKind>("bench", runs.subject, kSubjects);
  io.list("configs", suite.configs);
  io.list("factors", suite.factors);
  io.list("recordings", runs.recordings.training, true);
  io.optional("block_s", runs.block_s, positive());
  io.list("objectives", runs.objectives, true);
  io.section("seeds", runs.seeds);
  io.optional("threads", suite.threads, within(0, 1024));
  if (io.writing()) return;
  if (!io.has("bench")) io.problem("bench", "missing (required): ekf, amcl or mapping");
  if (runs.recordings.training.empty()) io.problem("recordings", "needs at least one");
  if (runs.objectives.empty()) io.problem("objectives", "needs at least one");
  checkConfigs(io, suite);
  if (suite.configs.empty()) suite.configs.push_back({"defaults", ""});
}

namespace {

Suite finished(ParamFile file, const std::string& name, const std::string& scenario_folder) {
  Suite suite;
  suite.path = suite.runs.path = name;
  describe(file.io(), suite);
  std::vector<pipeline::Config> configs;
  for (const NamedConfig& c : suite.configs) {
    configs.push_back(baseConfig(file.io(), "configs", c.file));
  }
  suite.runs.base = configs.front();
  Problems problems(name);
  checkFactors(problems, suite);
  checkObjectives(problems, suite.runs);
  checkRecordings(problems, suite.runs, scenario_folder, "recordings");
  try {
    file.finishReading();
  } catch (const ConfigError& e) {
    problems.add(e);
  }
  problems.raise();
  suite.variants = variantsOf(suite, configs);
  return suite;
}

}  // namespace

Suite loadSuite(const std::string& path, const std::string& scenario_folder) {
  return finished(ParamFile::fromFile(path), path, scenario_folder);
}

Suite parseSuite(
    const std::string& yaml, const std::string& name, const std::string& scenario_folder) {
  return finished(ParamFile::fromText(yaml, name), name, scenario_folder);
}

ConfigOf configOfVariant(const Suite& suite) {
  return [&suite](const std::vector<double>& values) {
    return suite.variants.at(static_cast<std::size_t>(values.at(0))).config;
  };
}

SuiteResult runSuite(
    const Suite& suite,
    const Subject& subject,
    Workers& workers,
    Journal& journal,
    const std::string& folder,
    const Callbacks& callbacks) {
  const int seeds = subject.random() ? suite.runs.seeds.count : 1;
  std::vector<SuiteRun> all;
  for (std::size_t v = 0; v < suite.variants.size(); ++v) {
    for (std::size_t d = 0; d < subject.drives(Role::kTraining); ++d) {
      for (int s = 0; s < seeds; ++s) {
        SuiteRun run;
        run.variant = v;
        run.run = {d, suite.runs.seeds.first + static_cast<std::uint64_t>(s)};
        if (!folder.empty()) {
          run.folder = folder + "/" + slug(suite.variants[v].name) + "/" + std::to_string(d + 1) +
                       "-" + slug(subject.name(Role::kTraining, d)) + "-seed-" +
                       std::to_string(run.run.seed);
        }
        all.push_back(std::move(run));
      }
    }
  }
  // The journal knows a run by its variant (as values) and by its recording and seed (as set).
  const auto set = [](const SuiteRun& run) {
    return std::to_string(run.run.drive) + "/" + std::to_string(run.run.seed);
  };
  const auto values = [](const SuiteRun& run) {
    return std::vector<double>{static_cast<double>(run.variant)};
  };
  std::vector<Task> tasks;
  std::vector<const SuiteRun*> of;
  for (const SuiteRun& run : all) {
    if (journal.find(set(run), values(run)) != nullptr) continue;
    tasks.push_back({values(run), Role::kTraining, run.run, run.folder});
    of.push_back(&run);
  }
  Status status;
  status.stage = "runs";
  status.planned = all.size();
  status.done = all.size() - tasks.size();
  callbacks.status(status);
  struct Stop {};
  SuiteResult result;
  try {
    workers.run(
        tasks,
        [&callbacks] {
          callbacks.heartbeat();
          if (callbacks.stop()) throw Stop{};
        },
        [&](std::size_t i, const Outcome& outcome) {
          journal.append(set(*of[i]), {tasks[i].values, {tasks[i].run}, {outcome}}, 0.0);
          ++status.done;
          callbacks.status(status);
        });
  } catch (const Stop&) {
    result.stopped_early = true;
  }
  for (SuiteRun& run : all) {
    const Evaluation* known = journal.find(set(run), values(run));
    if (known == nullptr) continue;
    run.outcome = known->outcomes.front();
    result.runs.push_back(std::move(run));
  }
  return result;
}

double meanScore(const Outcome& outcome, std::size_t objective) {
  if (objective >= outcome.objectives.size() || outcome.objectives[objective].empty()) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  double sum = 0.0;
  for (const Score& s : outcome.objectives[objective]) sum += s.value;
  return sum / static_cast<double>(outcome.objectives[objective].size());
}

std::string fingerprintOf(const Suite& suite) {
  Suite same = suite;
  same.threads = 0;  // changes the way, not the result
  std::string text = dumpParams(same);
  for (const Variant& v : suite.variants) text += dumpParams(v.config);
  char hex[24];
  std::snprintf(hex, sizeof hex, "%016llx", static_cast<unsigned long long>(derivedSeed(0, text)));
  return hex;
}

}  // namespace vestibule::tuning
