#include "vestibule/tuning/session.hpp"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <set>
#include <sstream>

#include "session_parts.hpp"
#include "vestibule/sim/scenario.hpp"
#include "vestibule/tuning/measures.hpp"
#include "vestibule/tuning/parameter_tree.hpp"
#include "vestibule/tuning/search_space.hpp"

namespace vestibule::tuning {
namespace {

namespace fs = std::filesystem;

const std::vector<std::pair<std::string_view, Measure>> kMeasures = {
    {"innovation_likelihood", Measure::kInnovation},
    {"hidden_outage", Measure::kHiddenOutage},
    {"ape", Measure::kApe},
    {"rpe", Measure::kRpe},
    {"odometry_rpe", Measure::kOdometryRpe},
    {"nees", Measure::kNees},
    {"nis", Measure::kNis},
    {"relations", Measure::kRelations},
    {"scan_likelihood", Measure::kScanLikelihood},
    {"wall_thickness", Measure::kWallThickness}};

/// What a run of the subject can be measured by.
bool measurable(SubjectKind subject, Measure measure) {
  switch (subject) {
    case SubjectKind::kEkf:
      return measure != Measure::kRelations && measure != Measure::kScanLikelihood &&
             measure != Measure::kWallThickness;
    case SubjectKind::kAmcl:
      return measure == Measure::kApe || measure == Measure::kRpe || measure == Measure::kRelations;
    case SubjectKind::kMapping:
      return measure == Measure::kApe || measure == Measure::kRpe ||
             measure == Measure::kRelations || measure == Measure::kScanLikelihood ||
             measure == Measure::kWallThickness;
  }
  return false;
}

/// Paths in a session are relative to its file. Empty stays empty.
std::string resolved(const ParamIo& io, const std::string& path) {
  if (path.empty() || fs::path(path).is_absolute()) return path;
  return (fs::path(io.here().file).parent_path() / path).lexically_normal().string();
}

/// One file, or two with the same bytes: a copy under another name is no other recording.
bool sameFile(const std::string& a, const std::string& b) {
  std::error_code ec;
  if (fs::equivalent(a, b, ec)) return true;
  if (!fs::is_regular_file(a, ec) || !fs::is_regular_file(b, ec)) return false;
  if (fs::file_size(a, ec) != fs::file_size(b, ec)) return false;
  std::ifstream in_a(a, std::ios::binary);
  std::ifstream in_b(b, std::ios::binary);
  if (!in_a || !in_b) return false;
  using Bytes = std::istreambuf_iterator<char>;
  return std::equal(Bytes(in_a), Bytes(), Bytes(in_b), Bytes());
}

/// Two entries that look at the same seconds of the same drive.
bool overlap(const RecordingSpec& a, const RecordingSpec& b) {
  const bool same_blocks =
      a.blocks == b.blocks || a.blocks == Blocks::kAll || b.blocks == Blocks::kAll;
  if (!same_blocks) return false;
  if (!a.log.empty() && !b.log.empty()) return a.log == b.log || sameFile(a.log, b.log);
  const auto end = [](const RecordingSpec& r) {
    return r.first_seed + static_cast<std::uint64_t>(std::max(1, r.drives));
  };
  return !a.scenario.empty() && a.scenario == b.scenario && a.first_seed < end(b) &&
         b.first_seed < end(a);
}

/// Whether a run of the subject reads the section that the parameter is in.
bool readBy(SubjectKind subject, const std::string& name) {
  const std::string section = name.substr(0, name.find('.'));
  if (section == "rig") return true;
  switch (subject) {
    case SubjectKind::kEkf:
      return section == "ekf";
    case SubjectKind::kAmcl:
      return section == "amcl" || section == "ekf" || section == "slice";
    case SubjectKind::kMapping:
      return section == "mapping" || section == "slice";
  }
  return false;
}

/// Numbers that exist, have an effect, are named once, and that the configuration takes at both
/// ends of the range.
void checkParameters(Problems& problems, const Session& session) {
  const ParameterTree tree(session.base);
  std::set<std::string> seen;
  for (const TunedParameter& p : session.parameters) {
    std::vector<std::string> names{p.name};
    names.insert(names.end(), p.ties.begin(), p.ties.end());
    bool good = !p.name.empty();
    for (const std::string& name : names) {
      if (name.empty()) continue;
      std::string text = tree.whyNot(name);
      if (text.empty() && !readBy(session.subject, name)) {
        text = "has no effect on " + std::string(toString(session.subject));
      }
      if (text.empty() && !seen.insert(name).second) text = "tuned twice";
      if (text.empty() && names.size() > 1 && tree.value(name) == 0.0) {
        text = "is 0 by default: ties keep a ratio, which is none";
      }
      good = good && text.empty();
      if (!text.empty()) problems.add(p.where, "parameters", name + ": " + text);
    }
    if (!good || !(p.from < p.to) || (p.log && !(p.from > 0.0))) continue;
    for (const double end : {p.from, p.to}) {
      try {
        (void)withValues(session.base, SearchSpace({p}, tree).named({end}));
      } catch (const ConfigError& e) {
        const std::string text = e.what();  // "tuned values:3: ekf....: must be > 0"
        problems.add(
            p.where,
            "parameters",
            "at " + shortNumber(end) + ": " + text.substr(text.find(' ', 13) + 1));
      }
    }
  }
}

/// The same seconds in two sets would make a gain look real that is not.
void checkOverlaps(Problems& problems, const Session& session) {
  const auto compare = [&](Role role, Role earlier) {
    for (const RecordingSpec& recording : session.recordings.of(role)) {
      for (const RecordingSpec& other : session.recordings.of(earlier)) {
        if (!overlap(recording, other)) continue;
        problems.add(
            recording.where,
            "recordings." + std::string(toString(role)),
            recording.name() + " is in " + std::string(toString(earlier)) + " too (line " +
                std::to_string(other.where.line) +
                "): take another recording, or even and odd blocks of this one");
      }
    }
  };
  compare(Role::kValidation, Role::kTraining);
  compare(Role::kFinal, Role::kTraining);
  compare(Role::kFinal, Role::kValidation);
}

}  // namespace

const std::vector<std::pair<std::string_view, SubjectKind>> kSubjects = {
    {"ekf", SubjectKind::kEkf}, {"amcl", SubjectKind::kAmcl}, {"mapping", SubjectKind::kMapping}};

void Problems::add(const SourceRef& where, const std::string& key, const std::string& text) {
  lines_.emplace_back(where.line, (key.empty() ? "" : key + ": ") + text);
}

void Problems::add(const ConfigError& e) {
  std::istringstream text(e.what());
  for (std::string line; std::getline(text, line);) {
    const std::size_t colon = line.find(": ");
    const std::size_t at = line.rfind(':', colon == std::string::npos ? colon : colon - 1);
    const bool whole = colon != std::string::npos && at != std::string::npos;
    lines_.emplace_back(
        whole ? std::atoi(line.c_str() + at + 1) : 1, whole ? line.substr(colon + 2) : line);
  }
}

void Problems::raise() {
  if (lines_.empty()) return;
  std::stable_sort(
      lines_.begin(), lines_.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::string text;
  for (const auto& [line, problem] : lines_) {
    text += (text.empty() ? "" : "\n") + file_ + ":" + std::to_string(std::max(1, line)) + ": " +
            problem;
  }
  throw ConfigError(text);
}

void requireFile(ParamIo& io, const char* key, std::string& path) {
  io.optional(key, path);
  if (io.writing() || path.empty()) return;
  path = resolved(io, path);
  std::error_code ec;
  if (!fs::is_regular_file(path, ec)) {
    io.problem(key, "no such file: " + path + " (paths are relative to the session file)");
  }
}

void checkObjectives(Problems& problems, const Session& session) {
  for (const Objective& o : session.objectives) {
    const std::string name(toString(o.measure));
    if (!measurable(session.subject, o.measure)) {
      problems.add(
          o.where,
          "objectives",
          name + " cannot be measured of " + std::string(toString(session.subject)) +
              " (docs/tuning.md lists which can)");
    }
    if (o.measure == Measure::kHiddenOutage && o.length_s > session.block_s) {
      problems.add(o.where, "objectives", "length_s must fit into block_s");
    }
  }
}

void checkRecordings(
    Problems& problems,
    const Session& session,
    const std::string& scenario_folder,
    const std::string& prefix) {
  const auto wants = [&session](Measure m) {
    return std::any_of(session.objectives.begin(), session.objectives.end(), [m](const auto& o) {
      return o.measure == m;
    });
  };
  for (const Role role : kRoles) {
    for (const RecordingSpec& r : session.recordings.of(role)) {
      const auto problem = [&](const std::string& text) {
        problems.add(
            r.where, prefix.back() == '.' ? prefix + std::string(toString(role)) : prefix, text);
      };
      if (session.subject == SubjectKind::kAmcl && r.map.empty() && r.scenario.empty()) {
        problem("amcl needs a map");
      }
      if (wants(Measure::kRelations) && measurable(session.subject, Measure::kRelations) &&
          r.relations.empty()) {
        problem("needs a relations file");
      }
      if (r.scenario.empty()) continue;
      try {
        (void)sim::loadScenario(r.scenario, scenario_folder);
      } catch (const ConfigError& e) {
        problem(e.what());
      }
    }
  }
}

pipeline::Config baseConfig(ParamIo& io, const char* key, const std::string& path) {
  std::error_code ec;
  if (!path.empty() && !fs::is_regular_file(path, ec)) return {};  // complained of already
  try {
    return pipeline::loadConfig(path);
  } catch (const ConfigError& e) {
    io.problem(key, e.what());
    return {};
  }
}

static void describe(ParamIo& io, TunedParameter& p) {
  // What cannot be read stays so: no second complaint about a range that was never given.
  if (!io.writing()) p.from = p.to = std::numeric_limits<double>::quiet_NaN();
  io.required("name", p.name);
  io.required("from", p.from);
  io.required("to", p.to);
  io.optional<bool>("scale", p.log, {{"log", true}, {"linear", false}});
  io.optional("ties", p.ties);
  if (io.writing()) return;
  p.where = io.here("name");
  if (p.from >= p.to) {
    io.problem(
        "to",
        "empty range: from " + shortNumber(p.from) + " to " + shortNumber(p.to) +
            "; from must be the smaller");
  }
  if (p.log && p.from <= 0.0) {
    io.problem("from", shortNumber(p.from) + ": a log scale needs a range above 0");
  }
}

void describe(ParamIo& io, RecordingSpec& r) {
  requireFile(io, "log", r.log);
  io.optional("scenario", r.scenario);
  io.optional("first_seed", r.first_seed);
  io.optional("drives", r.drives, within(1, 100000));
  io.optional<Blocks>(
      "blocks", r.blocks, {{"all", Blocks::kAll}, {"even", Blocks::kEven}, {"odd", Blocks::kOdd}});
  requireFile(io, "ref", r.ref);
  requireFile(io, "map", r.map);
  io.optional("init", r.init);
  requireFile(io, "relations", r.relations);
  if (io.writing()) return;
  r.where = io.here();
  if (io.has("log") == io.has("scenario")) io.problem("", "needs either a log or a scenario");
}

static void describe(ParamIo& io, Recordings& r) {
  io.list("training", r.training, true);
  io.list("validation", r.validation, true);
  io.list("final", r.final);
  if (io.writing()) return;
  if (r.training.empty()) io.problem("training", "needs at least one recording");
  if (r.validation.empty()) {
    io.problem("validation", "needs at least one recording: a gain is only believed on other data");
  }
}

void describe(ParamIo& io, Objective& o) {
  io.optional<Measure>("measure", o.measure, kMeasures);
  io.optional("weight", o.weight, positive());
  io.optional("length_s", o.length_s, positive());
  io.optional("step_s", o.step_s, positive());
  if (io.writing()) return;
  o.where = io.here("measure");
  if (!io.has("measure")) io.problem("", "needs a measure");
}

void describe(ParamIo& io, Seeds& s) {
  io.optional("first", s.first);
  io.optional("count", s.count, within(1, 1000));
  io.optional("fresh", s.fresh, within(1, 1000));
}

static void describe(ParamIo& io, SearchSpec& s) {
  io.optional<GlobalAlgorithm>(
      "global",
      s.global,
      {{"auto", GlobalAlgorithm::kAuto},
       {"direct_l", GlobalAlgorithm::kDirectL},
       {"crs2", GlobalAlgorithm::kCrs2},
       {"isres", GlobalAlgorithm::kIsres},
       {"none", GlobalAlgorithm::kNone}});
  io.optional<LocalAlgorithm>(
      "local",
      s.local,
      {{"auto", LocalAlgorithm::kAuto},
       {"bobyqa", LocalAlgorithm::kBobyqa},
       {"sbplx", LocalAlgorithm::kSbplx},
       {"none", LocalAlgorithm::kNone}});
  io.optional("evaluations", s.evaluations, within(1, 1000000));
  io.optional("islands", s.islands, within(1, 64));
  io.optional("global_share", s.global_share, within(0.0, 1.0));
  io.optional("wall_s", s.wall_s, nonNegative());
  io.optional("threads", s.threads, within(0, 1024));
  io.optional("slices", s.slices);
  if (!io.writing() && s.global == GlobalAlgorithm::kNone && s.local == LocalAlgorithm::kNone) {
    io.problem("local", "none, and global none as well: nothing would be searched");
  }
}

static void describe(ParamIo& io, Acceptance& a) {
  io.optional("gain", a.gain, within(0.0, 1.0));
  io.optional("confidence", a.confidence, inside(0.5, 1.0));
}

static void describe(ParamIo& io, Limits& l) {
  io.optional("cpu_ms_per_data_s", l.cpu_ms_per_data_s, nonNegative());
}

std::string_view toString(Measure measure) {
  for (const auto& [word, m] : kMeasures) {
    if (m == measure) return word;
  }
  return "?";
}

std::string_view unitOf(Measure measure) {
  switch (measure) {
    case Measure::kHiddenOutage:
    case Measure::kApe:
    case Measure::kRpe:
    case Measure::kOdometryRpe:
    case Measure::kRelations:
    case Measure::kWallThickness:
      return "m";
    case Measure::kInnovation:
    case Measure::kNees:
    case Measure::kNis:
    case Measure::kScanLikelihood:
      break;
  }
  return "";
}

bool measuresOdometryAlone(const Session& session) {
  const auto& measured = session.objectives;
  return std::all_of(measured.begin(), measured.end(), [](const Objective& o) {
    return o.measure == Measure::kOdometryRpe;
  });
}

std::string_view toString(SubjectKind kind) {
  for (const auto& [word, k] : kSubjects) {
    if (k == kind) return word;
  }
  return "?";
}

std::string_view toString(Role role) {
  switch (role) {
    case Role::kTraining:
      return "training";
    case Role::kValidation:
      return "validation";
    case Role::kFinal:
      return "final";
  }
  return "?";
}

std::string RecordingSpec::name() const {
  std::string text = scenario.empty() ? fs::path(log).filename().string() : scenario;
  if (blocks != Blocks::kAll) text += blocks == Blocks::kEven ? " (even blocks)" : " (odd blocks)";
  return text;
}

const std::vector<RecordingSpec>& Recordings::of(Role role) const {
  return role == Role::kTraining ? training : role == Role::kValidation ? validation : final;
}

void describe(ParamIo& io, Session& session) {
  io.optional<SubjectKind>("tune", session.subject, kSubjects);
  requireFile(io, "config", session.config_path);
  io.list("parameters", session.parameters, true);
  io.section("recordings", session.recordings);
  io.optional("block_s", session.block_s, positive());
  io.list("objectives", session.objectives, true);
  io.section("seeds", session.seeds);
  io.section("search", session.search);
  io.section("accept", session.accept);
  io.section("limits", session.limits);
  if (io.writing()) return;
  if (!io.has("recordings")) io.problem("recordings", "missing (required)");
  if (session.parameters.empty()) io.problem("parameters", "needs at least one");
  if (session.objectives.empty()) io.problem("objectives", "needs at least one");
  session.base = baseConfig(io, "config", session.config_path);
}

namespace {

Session finished(ParamFile file, const std::string& name, const std::string& scenario_folder) {
  Session session;
  session.path = name;
  describe(file.io(), session);
  Problems problems(name);
  checkParameters(problems, session);
  checkObjectives(problems, session);
  checkRecordings(problems, session, scenario_folder, "recordings.");
  checkOverlaps(problems, session);
  try {
    file.finishReading();
  } catch (const ConfigError& e) {
    problems.add(e);
  }
  problems.raise();
  return session;
}

}  // namespace

Session loadSession(const std::string& path, const std::string& scenario_folder) {
  return finished(ParamFile::fromFile(path), path, scenario_folder);
}

Session parseSession(
    const std::string& yaml, const std::string& name, const std::string& scenario_folder) {
  return finished(ParamFile::fromText(yaml, name), name, scenario_folder);
}

}  // namespace vestibule::tuning
