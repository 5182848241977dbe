#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "run_output.hpp"
#include "terminal.hpp"
#include "tune_progress.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/parallel.hpp"
#include "vestibule/gui_headless/charts.hpp"
#include "vestibule/tuning/engine.hpp"
#include "vestibule/tuning/measures.hpp"
#include "vestibule/tuning/mpi_workers.hpp"
#include "vestibule/tuning/subjects.hpp"

namespace vestibule::app {
namespace {

using tuning::Gain;
using tuning::Role;
using tuning::Session;
using tuning::TuningResult;

constexpr std::size_t kPathsShown = 3;

/// The commit of the source tree the program belongs to.
std::string commitOfTree() {
  const std::string command = "git -C '" + shipped("") + "' rev-parse --short=12 HEAD 2>/dev/null";
  std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  std::array<char, 64> line{};
  if (!pipe || std::fgets(line.data(), line.size(), pipe.get()) == nullptr) return "unknown";
  std::string commit = line.data();
  commit.erase(commit.find_last_not_of("\n") + 1);
  return commit.empty() ? "unknown" : commit;
}

std::string percent(double share) { return fixed(100.0 * share, 1) + " %"; }

Json toJson(const Gain& g) {
  Json json;
  json["gain"] = rounded(g.gain, 6);
  json["low"] = rounded(g.low, 6);
  json["high"] = rounded(g.high, 6);
  json["p_value"] = rounded(g.p_value, 6);
  json["blocks"] = g.blocks;
  if (!g.failure.empty()) json["failure"] = g.failure;
  return json;
}

Json toJson(const tuning::SearchSpace& space, const std::vector<double>& values) {
  Json json = Json::object();
  for (const auto& [name, value] : space.named(values)) json[name] = value;
  return json;
}

/// The tuned file with where it comes from.
std::string tunedYaml(
    const Session& session,
    const tuning::SearchSpace& space,
    const tuning::Subject& subject,
    const TuningResult& r) {
  std::string text = "# Tuned with 'vestibule tune " + session.path + "' at commit " +
                     commitOfTree() + ", session " + tuning::fingerprintOf(session) + ".\n";
  for (const Role role : tuning::kRoles) {
    if (subject.drives(role) == 0) continue;
    text += "# " + std::string(toString(role)) + ":";
    for (std::size_t i = 0; i < subject.drives(role); ++i) {
      text += (i > 0 ? ", " : " ") + subject.name(role, i);
    }
    text += "\n";
  }
  text += "# " + r.verdict + "\n\n";
  return text + tuning::asYaml(space.named(r.winner));
}

void summarise(
    const Session& session, const tuning::SearchSpace& space, const TuningResult& r, Json& s) {
  s["session"] = session.path;
  s["fingerprint"] = tuning::fingerprintOf(session);
  s["tuned"] = r.accepted;
  s["verdict"] = r.verdict;
  s["algorithms"] = r.algorithms;
  s["evaluations"] = r.tried.size();
  s["failed"] = r.failures;
  s["stopped_early"] = r.stopped_early;
  s["defaults"] = toJson(space, r.defaults);
  s["winner"] = toJson(space, r.winner);
  s["training"] = toJson(r.training);
  s["validation"] = toJson(r.validation);
  if (r.final) s["final"] = toJson(*r.final);
  for (const auto& level : r.levels) {
    s["levels"][level.measure] = {rounded(level.before, 6), rounded(level.after, 6)};
  }
  s["left_out"] = Json::array();
  for (const auto& row : r.left_out) {
    Json json = toJson(row.gain);
    json["drive"] = row.drive;
    s["left_out"].push_back(std::move(json));
  }
  s["slices"] = Json::object();
  for (const auto& slice : r.slices) s["slices"][slice.parameter] = slice.points;
  s["correlations"] = r.correlations;
}

std::string intervalOf(const Gain& g) {
  if (!g.failure.empty()) return g.failure;
  return percent(g.low) + " to " + percent(g.high);
}

gui_headless::Table parameterTable(const tuning::SearchSpace& space, const TuningResult& r) {
  gui_headless::Table table;
  table.title = "Parameters";
  table.header = {"parameter", "default", "best found", "range", ""};
  for (std::size_t i = 0; i < space.size(); ++i) {
    const auto& p = space.parameters()[i];
    const double u = space.cube(r.winner)[i];
    std::string note;
    if (u < 0.01 || u > 0.99) note = "at the edge of its range: widen it";
    for (const std::string& tie : p.ties) note += (note.empty() ? "with " : ", with ") + tie;
    table.rows.push_back(
        {p.name,
         tuning::shortNumber(r.defaults[i]),
         tuning::shortNumber(r.winner[i]),
         tuning::shortNumber(p.from) + " to " + tuning::shortNumber(p.to),
         note});
  }
  return table;
}

std::string convergenceChart(const TuningResult& r) {
  gui_headless::LineChart chart;
  chart.title = "Search";
  chart.x_label = "candidate";
  chart.y_label = "cost, against the defaults [%]";
  chart.include_zero = false;
  gui_headless::Series best{"best so far", gui_headless::SeriesLook::kEstimate, {}};
  double least = 1.0;
  for (std::size_t i = 0; i < r.tried.size(); ++i) {
    least = std::min(least, r.tried[i].cost);
    best.points.emplace_back(static_cast<double>(i + 1), 100.0 * (least - 1.0));
  }
  chart.series.push_back(std::move(best));
  return gui_headless::lineChart(chart);
}

std::string sliceChart(const tuning::Slice& slice, double winner) {
  gui_headless::LineChart chart;
  chart.title = slice.parameter;
  chart.x_label = "value";
  chart.y_label = "cost, against the defaults [%]";
  chart.include_zero = false;
  gui_headless::Series series{"training", gui_headless::SeriesLook::kEstimate, {}};
  for (const auto& [value, cost] : slice.points) {
    if (cost < tuning::kPenalty) series.points.emplace_back(value, 100.0 * (cost - 1.0));
  }
  chart.series.push_back(std::move(series));
  chart.markers.push_back({winner, "found"});
  return gui_headless::lineChart(chart);
}

gui_headless::ReportSection resultSection(
    const Session& session, const tuning::SearchSpace& space, const TuningResult& r) {
  gui_headless::ReportSection section;
  section.title = r.accepted ? "Tuned" : "Keep the defaults";
  section.text = r.verdict + ".";
  section.figures = {
      figure("gain on validation data", percent(r.validation.gain)),
      figure(
          tuning::shortNumber(100.0 * session.accept.confidence) + " % interval",
          intervalOf(r.validation)),
      figure("p-value (default and candidate swapped)", fixed(r.validation.p_value, 4)),
      figure("blocks of validation data", std::to_string(r.validation.blocks)),
      figure("gain on training data", percent(r.training.gain)),
      figure("candidates tried", std::to_string(r.tried.size())),
      figure("... of which failed", std::to_string(r.failures)),
      figure("algorithms", r.algorithms)};
  if (r.final) {
    section.figures.push_back(figure("gain on the final set", percent(r.final->gain)));
    section.figures.push_back(figure("... interval", intervalOf(*r.final)));
  }
  section.tables.push_back(parameterTable(space, r));
  gui_headless::Table levels;
  levels.title = "Objectives on the validation data";
  levels.header = {"objective", "defaults", "best found", "unit"};
  for (std::size_t i = 0; i < r.levels.size(); ++i) {
    const auto& level = r.levels[i];
    levels.rows.push_back(
        {level.measure,
         fixed(level.before, 4),
         fixed(level.after, 4),
         std::string(unitOf(session.objectives[i].measure))});
  }
  section.tables.push_back(std::move(levels));
  if (!r.rescored.empty()) {
    gui_headless::Table table;
    table.title = "The best on seeds the search has not seen: cost / cost of the defaults";
    table.header = {"training seeds", "fresh seeds"};
    for (const auto& row : r.rescored) {
      table.rows.push_back({fixed(row.training, 4), fixed(row.fresh, 4)});
    }
    section.tables.push_back(std::move(table));
  }
  if (!r.left_out.empty()) {
    gui_headless::Table table;
    table.title = "Each training recording left out of the choice, then scored";
    table.header = {"recording", "gain there", "interval", "gain on the others"};
    for (const auto& row : r.left_out) {
      table.rows.push_back(
          {row.drive,
           percent(row.gain.gain),
           intervalOf(row.gain),
           percent(1.0 - row.cost_of_choice)});
    }
    section.tables.push_back(std::move(table));
  }
  if (!r.correlations.empty()) {
    gui_headless::Table table;
    table.title = "Correlation of the parameters among the best candidates";
    table.header = {""};
    // Numbers for names: so the table stays narrow.
    for (std::size_t i = 0; i < space.size(); ++i) table.header.push_back(std::to_string(i + 1));
    for (std::size_t i = 0; i < space.size(); ++i) {
      std::vector<std::string> row{std::to_string(i + 1) + "  " + space.parameters()[i].name};
      // Rounded first: nothing shows as -0.00.
      for (const double c : r.correlations[i]) row.push_back(fixed(rounded(c, 2) + 0.0, 2));
      table.rows.push_back(std::move(row));
    }
    section.tables.push_back(std::move(table));
  }
  section.charts.push_back(convergenceChart(r));
  for (std::size_t i = 0; i < r.slices.size(); ++i) {
    section.charts.push_back(sliceChart(r.slices[i], r.winner[i]));
  }
  return section;
}

/// Tuned (line) against default (dashed) on a validation drive.
gui_headless::ReportSection pathSection(
    const std::string& name,
    const tuning::Subject::Paths& before,
    const tuning::Subject::Paths& after) {
  gui_headless::RunRecorder recorder;
  Observers observers;
  observers.attach(recorder);
  for (const metrics::TimedPose& p : after.estimate) {
    PoseEvent event;
    event.stamp = p.stamp;
    event.source = PoseSource::kPublished;
    event.T.mean = p.pose;
    observers.emit(event);
  }
  gui_headless::Scene scene;
  scene.reference = asReference(before.estimate);
  gui_headless::OverviewStyle style;
  style.path_words = "best found";
  style.reference_words = "defaults";
  gui_headless::ReportSection section;
  section.title = name;
  section.pictures.push_back(
      {"best found (line) against the defaults (dashed)",
       gui_headless::renderOverview(recorder, scene, style)});
  const auto rmse = [](const tuning::Subject::Paths& p) {
    metrics::AssociationOptions association;
    association.matching = metrics::Matching::kInterpolated;
    association.max_dt = std::chrono::seconds(2);
    return metrics::absoluteErrors(
               metrics::associate(p.estimate, p.reference, association), metrics::Alignment::kNone)
        .translation_m.rmse;
  };
  if (!after.reference.empty()) {
    section.figures = {
        figure("position RMSE, defaults", fixed(rmse(before), 3), "m"),
        figure("position RMSE, best found", fixed(rmse(after), 3), "m")};
  }
  return section;
}

void writeResult(
    const Session& session,
    const tuning::SearchSpace& space,
    const tuning::Subject& subject,
    const TuningResult& r,
    RunOutput& output) {
  summarise(session, space, r, output.summary());
  if (r.accepted) output.text("tuned.yaml", tunedYaml(session, space, subject, r));
  gui_headless::Report report;
  report.title = "Vestibule: tune";
  report.subtitle = session.path;
  report.sections.push_back(resultSection(session, space, r));
  const pipeline::Config best = tuning::withValues(session.base, space.named(r.winner));
  for (std::size_t i = 0; i < std::min(kPathsShown, subject.drives(Role::kValidation)); ++i) {
    const auto before = subject.paths(session.base, Role::kValidation, i);
    const auto after = subject.paths(best, Role::kValidation, i);
    if (i == 0) {
      output.trajectory(after.estimate);
      output.trajectory(before.estimate, "defaults.tum");
    }
    report.sections.push_back(pathSection(subject.name(Role::kValidation, i), before, after));
    if (tuning::measuresOdometryAlone(session)) {
      report.sections.back().text =
          "The odometry filter (T_odom_base), laid on the start of the reference.";
    }
    output.picture(
        "paths_" + std::to_string(i + 1) + ".png", report.sections.back().pictures.front().png);
  }
  output.report(report);
}

tuning::Folders folders() { return {shipped("config/csv"), shipped("config/scenarios")}; }

/// What all ranks but the first do.
void serve(const Session& session, const tuning::MpiWorld& world) {
  const tuning::SearchSpace space(session.parameters, tuning::ParameterTree(session.base));
  const auto subject = tuning::makeSubject(session, folders(), [](double, double) {});
  tuning::serveTasks(
      tuning::TaskRunner(tuning::configOfCandidate(session, space), *subject, session.limits),
      world);
}

std::unique_ptr<tuning::Workers> makeWorkers(
    const tuning::TaskRunner& runner, tuning::MpiWorld* world, int threads) {
  if (world != nullptr) return std::make_unique<tuning::MpiWorkers>(runner, *world);
  return std::make_unique<tuning::ThreadWorkers>(runner, threadCount(threads));
}

void runTune(const std::string& path, const std::string& out, int threads, int& exit_code) {
  std::unique_ptr<tuning::MpiWorld> world;
  if (tuning::launchedByMpi()) world = std::make_unique<tuning::MpiWorld>();
  const Session session = tuning::loadSession(path, shipped("config/scenarios"));
  if (world && world->rank() > 0) return serve(session, *world);
  const tuning::SearchSpace space(session.parameters, tuning::ParameterTree(session.base));
  RunOutput output(out, "tune", session.base);
  TuningResult result;
  std::unique_ptr<tuning::Subject> subject;
  double wall_s = 0.0;
  std::string workers_text;
  {
    const std::string journal_path = output.pathOf("evaluations.jsonl");
    tuning::Journal journal(journal_path, tuning::fingerprintOf(session));
    ProgressBar bar("reading recordings");
    subject = tuning::makeSubject(session, folders(), bar.callback());
    const tuning::TaskRunner runner(
        tuning::configOfCandidate(session, space), *subject, session.limits);
    const auto workers =
        makeWorkers(runner, world.get(), threads > 0 ? threads : session.search.threads);
    TuneProgress progress(journal_path);
    const auto began = std::chrono::steady_clock::now();
    result = tuning::tune(session, space, *subject, *workers, journal, progress.callbacks());
    workers_text = workers->text();
    wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  }
  writeResult(session, space, *subject, result, output);
  output.timing(wall_s, 0.0);
  output.finish();
  std::printf(
      "%zu candidates, %s%s, %.1f s with %s\n%s\n",
      result.tried.size(),
      result.algorithms.c_str(),
      result.stopped_early ? " (stopped early)" : "",
      wall_s,
      workers_text.c_str(),
      result.verdict.c_str());
  if (result.accepted) std::printf("tuned: %s\n", output.pathOf("tuned.yaml").c_str());
  std::printf("report: %s\n", output.pathOf("report.html").c_str());
  exit_code = kDone;
}

}  // namespace

void addTune(CLI::App& app, int& exit_code) {
  struct Options {
    std::string session;
    std::string out;
    int threads = 0;
  };
  auto o = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "tune", "searches better parameters and says whether the gain is real (docs/tuning.md)");
  command->add_option("SESSION", o->session, "YAML of the session, as those in config/tuning")
      ->required();
  command->add_option("--threads", o->threads, "runs at once (default: as the session says)")
      ->check(CLI::Range(1, 1024));
  command->add_option("--out", o->out, "output folder; a killed session there is gone on with")
      ->required();
  command->callback([o, &exit_code] { runTune(o->session, o->out, o->threads, exit_code); });
}

}  // namespace vestibule::app
