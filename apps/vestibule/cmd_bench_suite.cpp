#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <sstream>

#include "commands.hpp"
#include "run_output.hpp"
#include "terminal.hpp"
#include "tune_progress.hpp"
#include "vestibule/core/parallel.hpp"
#include "vestibule/gui_headless/map_sheet.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/metrics/statistics.hpp"
#include "vestibule/tuning/measures.hpp"
#include "vestibule/tuning/mpi_workers.hpp"
#include "vestibule/tuning/parameter_tree.hpp"
#include "vestibule/tuning/subjects.hpp"
#include "vestibule/tuning/suite.hpp"

namespace vestibule::app {
namespace {

using tuning::Role;
using tuning::Suite;
using tuning::SuiteResult;
using tuning::SuiteRun;

constexpr int kSheetColumns = 6;

/// A variant on one recording, over all seeds.
struct Row {
  std::size_t variant = 0;
  std::size_t drive = 0;
  std::vector<std::vector<double>> scores;  ///< by objective
  std::vector<double> cpu_ms_per_s;
  std::size_t failed = 0;
  std::string folder;  ///< of its first run
};

double mean(const std::vector<double>& v) {
  double sum = 0.0;
  for (const double x : v) sum += x;
  return v.empty() ? std::nan("") : sum / static_cast<double>(v.size());
}

double spread(const std::vector<double>& v) {
  const double m = mean(v);
  double sum = 0.0;
  for (const double x : v) sum += (x - m) * (x - m);
  return v.size() < 2 ? 0.0 : std::sqrt(sum / static_cast<double>(v.size() - 1));
}

double cpuLoad(const SuiteRun& run, const tuning::Subject& subject) {
  return 1e3 * run.outcome.cpu_s / std::max(subject.seconds(Role::kTraining, run.run.drive), 1e-3);
}

std::vector<Row> rowsOf(
    const Suite& suite, const SuiteResult& result, const tuning::Subject& subject) {
  std::vector<Row> rows;
  for (const SuiteRun& run : result.runs) {
    if (rows.empty() || rows.back().variant != run.variant || rows.back().drive != run.run.drive) {
      rows.push_back({run.variant, run.run.drive, {}, {}, 0, run.folder});
      rows.back().scores.resize(suite.runs.objectives.size());
    }
    Row& row = rows.back();
    row.cpu_ms_per_s.push_back(cpuLoad(run, subject));
    if (!run.outcome.failure.empty()) ++row.failed;
    for (std::size_t o = 0; o < row.scores.size(); ++o) {
      const double score = tuning::meanScore(run.outcome, o);
      if (std::isfinite(score)) row.scores[o].push_back(score);
    }
  }
  return rows;
}

std::string csvText(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

/// One line per run; CPU time, which differs from time to time, comes last.
std::string runsCsv(const Suite& suite, const SuiteResult& result, const tuning::Subject& subject) {
  std::string text = "variant";
  for (const auto& f : suite.factors) text += "," + f.name;
  text += ",recording,seed";
  for (const auto& o : suite.runs.objectives) text += "," + std::string(toString(o.measure));
  text += ",failure,data_s,cpu_s\n";
  for (const SuiteRun& run : result.runs) {
    const tuning::Variant& v = suite.variants[run.variant];
    text += csvText(v.name);
    for (const double level : v.levels) text += "," + tuning::shortNumber(level);
    text += "," + csvText(subject.name(Role::kTraining, run.run.drive)) + "," +
            std::to_string(run.run.seed);
    for (std::size_t o = 0; o < suite.runs.objectives.size(); ++o) {
      const double score = tuning::meanScore(run.outcome, o);
      text += "," + (std::isfinite(score) ? tuning::shortNumber(score) : "");
    }
    text += "," + csvText(run.outcome.failure) + "," +
            fixed(subject.seconds(Role::kTraining, run.run.drive), 3) + "," +
            fixed(run.outcome.cpu_s, 3) + "\n";
  }
  return text;
}

/// Names of the objectives with their units, as columns.
void addObjectives(const Suite& suite, gui_headless::Table& table) {
  for (const auto& o : suite.runs.objectives) {
    const std::string unit(unitOf(o.measure));
    table.header.push_back(
        std::string(toString(o.measure)) + (unit.empty() ? "" : " [" + unit + "]"));
  }
}

/// The table for people, and for the terminal.
gui_headless::Table tableOf(
    const Suite& suite, const std::vector<Row>& rows, const tuning::Subject& subject) {
  const bool drives = subject.drives(Role::kTraining) > 1;
  gui_headless::Table table;
  table.title = "Mean over the seeds +- standard deviation";
  table.header = {"variant"};
  if (drives) table.header.push_back("recording");
  addObjectives(suite, table);
  table.header.insert(table.header.end(), {"failed", "CPU load %"});
  for (const Row& row : rows) {
    std::vector<std::string> cells{suite.variants[row.variant].name};
    if (drives) cells.push_back(subject.name(Role::kTraining, row.drive));
    for (const auto& scores : row.scores) {
      cells.push_back(
          scores.empty()      ? "-"
          : scores.size() < 2 ? fixed(mean(scores), 4)
                              : fixed(mean(scores), 4) + " +- " + fixed(spread(scores), 4));
    }
    cells.push_back(std::to_string(row.failed));
    cells.push_back(fixed(0.1 * mean(row.cpu_ms_per_s), 2));
    table.rows.push_back(std::move(cells));
  }
  return table;
}

/// For every value of a factor, the mean over all the rest.
gui_headless::Table mainEffects(const Suite& suite, const std::vector<Row>& rows) {
  gui_headless::Table table;
  table.title = "Each factor alone: mean over all other factors, recordings and seeds";
  table.header = {"factor", "value"};
  addObjectives(suite, table);
  table.header.push_back("CPU load %");
  for (std::size_t f = 0; f < suite.factors.size(); ++f) {
    for (const double value : suite.factors[f].values) {
      std::vector<std::vector<double>> scores(suite.runs.objectives.size());
      std::vector<double> cpu;
      for (const Row& row : rows) {
        if (suite.variants[row.variant].levels[f] != value) continue;
        cpu.insert(cpu.end(), row.cpu_ms_per_s.begin(), row.cpu_ms_per_s.end());
        for (std::size_t o = 0; o < scores.size(); ++o) {
          scores[o].insert(scores[o].end(), row.scores[o].begin(), row.scores[o].end());
        }
      }
      std::vector<std::string> cells{suite.factors[f].name, tuning::shortNumber(value)};
      for (const auto& s : scores) cells.push_back(s.empty() ? "-" : fixed(mean(s), 4));
      cells.push_back(cpu.empty() ? "-" : fixed(0.1 * mean(cpu), 2));
      table.rows.push_back(std::move(cells));
    }
  }
  return table;
}

/// Name and figures of a map's variant, two to a line.
std::vector<std::string> captionOf(const Suite& suite, const Row& row) {
  std::vector<std::string> words;
  std::istringstream name(suite.variants[row.variant].name);
  for (std::string word; name >> word;) words.push_back(word);
  for (std::size_t o = 0; o < row.scores.size(); ++o) {
    if (row.scores[o].empty()) continue;
    words.push_back(
        std::string(toString(suite.runs.objectives[o].measure)) + " " +
        fixed(row.scores[o].front(), 3));
  }
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i % 2 == 0) {
      lines.push_back(words[i]);
    } else {
      lines.back() += "  " + words[i];
    }
  }
  return lines;
}

/// The maps of each recording's first seed, one sheet per recording.
void addMaps(
    const Suite& suite,
    const std::vector<Row>& rows,
    const tuning::Subject& subject,
    gui_headless::ReportSection& section,
    RunOutput& output) {
  for (std::size_t d = 0; d < subject.drives(Role::kTraining); ++d) {
    std::vector<grid::OccupancyMap> maps;
    std::vector<gui_headless::MapPanel> panels;
    for (const Row& row : rows) {
      const std::string path = row.folder + "/map.yaml";
      std::error_code ec;
      if (row.drive != d || row.folder.empty() || !std::filesystem::exists(path, ec)) continue;
      maps.push_back(io::loadMap(path));
      panels.push_back({nullptr, captionOf(suite, row)});
    }
    for (std::size_t i = 0; i < maps.size(); ++i) panels[i].map = &maps[i];
    const std::string png = gui_headless::renderMapSheet(panels, kSheetColumns);
    if (png.empty()) continue;
    section.pictures.push_back(
        {subject.name(Role::kTraining, d) + ", first seed of every variant", png});
    output.picture("maps_" + std::to_string(d + 1) + ".png", png);
  }
}

void summarise(
    const Suite& suite,
    const std::vector<Row>& rows,
    const tuning::Subject& subject,
    const SuiteResult& result,
    Json& s) {
  s["suite"] = suite.path;
  s["fingerprint"] = tuning::fingerprintOf(suite);
  s["runs"] = result.runs.size();
  s["stopped_early"] = result.stopped_early;
  s["table"] = Json::array();
  for (const Row& row : rows) {
    Json json;
    json["variant"] = suite.variants[row.variant].name;
    json["recording"] = subject.name(Role::kTraining, row.drive);
    json["failed"] = row.failed;
    for (std::size_t o = 0; o < row.scores.size(); ++o) {
      if (row.scores[o].empty()) continue;
      json[std::string(toString(suite.runs.objectives[o].measure))] = {
          {"mean", rounded(mean(row.scores[o]), 6)}, {"sigma", rounded(spread(row.scores[o]), 6)}};
    }
    s["table"].push_back(std::move(json));
  }
}

tuning::Folders folders() { return {shipped("config/csv"), shipped("config/scenarios")}; }

void runSuite(const std::string& path, const std::string& out, int threads, int& exit_code) {
  std::unique_ptr<tuning::MpiWorld> world;
  if (tuning::launchedByMpi()) world = std::make_unique<tuning::MpiWorld>();
  const Suite suite = tuning::loadSuite(path, shipped("config/scenarios"));
  if (world && world->rank() > 0) {
    const auto subject = tuning::makeSubject(suite.runs, folders(), [](double, double) {});
    tuning::serveTasks(tuning::TaskRunner(tuning::configOfVariant(suite), *subject), *world);
    return;
  }
  RunOutput output(out, "bench suite", suite.runs.base);
  SuiteResult result;
  std::unique_ptr<tuning::Subject> subject;
  double wall_s = 0.0;
  std::string workers_text;
  {
    const std::string journal_path = output.pathOf("runs.jsonl");
    tuning::Journal journal(journal_path, tuning::fingerprintOf(suite), true);
    ProgressBar bar("reading recordings");
    subject = tuning::makeSubject(suite.runs, folders(), bar.callback());
    const tuning::TaskRunner runner(tuning::configOfVariant(suite), *subject);
    std::unique_ptr<tuning::Workers> workers;
    if (world) {
      workers = std::make_unique<tuning::MpiWorkers>(runner, *world);
    } else {
      workers = std::make_unique<tuning::ThreadWorkers>(
          runner, threadCount(threads > 0 ? threads : suite.threads));
    }
    TuneProgress progress(journal_path);
    result = tuning::runSuite(
        suite, *subject, *workers, journal, output.pathOf("runs"), progress.callbacks());
    workers_text = workers->text();
    wall_s = bar.wallSeconds();
  }
  const std::vector<Row> rows = rowsOf(suite, result, *subject);
  summarise(suite, rows, *subject, result, output.summary());
  output.text("runs.csv", runsCsv(suite, result, *subject));
  const gui_headless::Table table = tableOf(suite, rows, *subject);
  gui_headless::ReportSection section;
  section.title = "Table";
  section.text =
      "CPU load: CPU time of a run over the length of its recording, on the machine that ran it.";
  section.tables.push_back(table);
  if (!suite.factors.empty()) section.tables.push_back(mainEffects(suite, rows));
  addMaps(suite, rows, *subject, section, output);
  gui_headless::Report report;
  report.title = "Vestibule: bench suite";
  report.subtitle = suite.path;
  report.sections.push_back(std::move(section));
  output.report(report);
  double data_s = 0.0;
  std::size_t failed = 0;
  for (const SuiteRun& run : result.runs) {
    data_s += subject->seconds(Role::kTraining, run.run.drive);
    failed += run.outcome.failure.empty() ? 0U : 1U;
  }
  output.timing(wall_s, data_s);
  output.finish();
  std::vector<std::vector<std::string>> text{table.header};
  text.insert(text.end(), table.rows.begin(), table.rows.end());
  std::fputs(textTable(text).c_str(), stdout);
  std::printf(
      "%zu runs, %zu failed%s, %.1f s with %s\nruns: %s\nreport: %s\n",
      result.runs.size(),
      failed,
      result.stopped_early ? " (stopped early; the same command goes on)" : "",
      wall_s,
      workers_text.c_str(),
      output.pathOf("runs.csv").c_str(),
      output.pathOf("report.html").c_str());
  exit_code = failed > 0 || result.stopped_early ? kFailedPurpose : kDone;
}

}  // namespace

void addBenchSuite(CLI::App& bench, int& exit_code) {
  struct Options {
    std::string suite;
    std::string out;
    int threads = 0;
  };
  auto o = std::make_shared<Options>();
  CLI::App* command = bench.add_subcommand(
      "suite", "a table of configurations x recordings x seeds (docs/tuning.md)");
  command->add_option("SUITE", o->suite, "YAML of the suite, as those in config/suites")
      ->required();
  command->add_option("--threads", o->threads, "runs at once (default: as the suite says)")
      ->check(CLI::Range(1, 1024));
  command->add_option("--out", o->out, "output folder; a killed suite there is gone on with")
      ->required();
  command->callback([o, &exit_code] { runSuite(o->suite, o->out, o->threads, exit_code); });
}

}  // namespace vestibule::app
