#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "commands.hpp"
#include "run_output.hpp"
#include "terminal.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/gui_headless/map_sheet.hpp"
#include "vestibule/gui_headless/report.hpp"
#include "vestibule/pipeline/place_bench.hpp"

namespace vestibule::app {
namespace {

struct Arguments {
  std::vector<std::string> maps;
  std::vector<std::string> worlds;
  std::string config;
  std::string out;
  std::uint64_t seed = 1;
  int places = 200;
};

constexpr double kRightBar = 0.98;
constexpr double kWrongBar = 0.005;
constexpr double kSearchBar_m2ps = 100.0 * 60.0;

/// A share with its 95 % interval by the bootstrap.
struct Share {
  double value = 0.0;
  double low = 0.0;
  double high = 0.0;
};

Share shareOf(
    const std::vector<pipeline::LostTrial>& trials,
    pipeline::LostOutcome outcome,
    std::uint64_t seed) {
  std::vector<double> hits;
  for (const auto& trial : trials) hits.push_back(trial.outcome == outcome ? 1.0 : 0.0);
  const auto n = static_cast<double>(hits.size());
  Share share;
  for (const double hit : hits) share.value += hit / n;
  constexpr int kResamples = 2000;
  std::vector<double> means;
  RandomStream rng(seed, "bootstrap");
  for (int i = 0; i < kResamples; ++i) {
    double mean = 0.0;
    for (std::size_t k = 0; k < hits.size(); ++k) {
      mean += hits[static_cast<std::size_t>(rng.uniform() * n)] / n;
    }
    means.push_back(mean);
  }
  std::sort(means.begin(), means.end());
  share.low = means[kResamples / 40];
  share.high = means[kResamples - kResamples / 40 - 1];
  return share;
}

std::string percent(const Share& share) {
  return fixed(100.0 * share.value, 1) + " [" + fixed(100.0 * share.low, 1) + ", " +
         fixed(100.0 * share.high, 1) + "]";
}

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[std::min(
      values.size() - 1, static_cast<std::size_t>(q * static_cast<double>(values.size())))];
}

const char* toString(pipeline::LostOutcome outcome) {
  switch (outcome) {
    case pipeline::LostOutcome::kRight:
      return "right";
    case pipeline::LostOutcome::kWrong:
      return "wrong";
    case pipeline::LostOutcome::kUnsure:
      break;
  }
  return "unsure";
}

Json toJson(const Pose2& T) { return {rounded(T.x, 4), rounded(T.y, 4), rounded(T.phi, 5)}; }

/// The candidates that were left, best first.
Json placesJson(const std::vector<amcl::Place>& places) {
  constexpr std::size_t kMost = 5;
  Json list = Json::array();
  for (std::size_t i = 0; i < std::min(kMost, places.size()); ++i) {
    Json p;
    p["pose"] = toJson(places[i].T_map_base.mean);
    p["weight"] = rounded(places[i].weight, 6);
    p["inlier_share"] = rounded(places[i].inlier_share, 3);
    p["blocked_share"] = rounded(places[i].blocked_share, 3);
    list.push_back(p);
  }
  return list;
}

gui_headless::Figure shareFigure(
    const std::string& label,
    const Share& share,
    std::optional<bool> good = {},
    std::string bar = {}) {
  gui_headless::Figure f = figure(label, percent(share), "%");
  f.bar = std::move(bar);
  using Verdict = gui_headless::Figure::Verdict;
  if (good) f.verdict = *good ? Verdict::kGood : Verdict::kBad;
  return f;
}

std::string words(const Pose2& T) {
  return fixed(T.x, 2) + ", " + fixed(T.y, 2) + ", " + fixed(radToDeg(T.phi), 0);
}

/// Where the robots were put down and how it ended, and all that was not right.
gui_headless::ReportSection lostSection(
    const grid::OccupancyMap& map,
    const std::string& name,
    const std::vector<pipeline::LostTrial>& trials) {
  gui_headless::ReportSection section;
  section.title = name;
  gui_headless::MapPanel panel{&map, {"where the robots were put down"}};
  gui_headless::Table misses{
      "Not right",
      {"outcome",
       "put down at x, y [m], yaw [deg]",
       "truth at the end",
       "claimed, or likeliest",
       "its weight",
       "driven [m]"},
      {}};
  for (const auto& trial : trials) {
    using Look = gui_headless::MapMark::Look;
    const bool right = trial.outcome == pipeline::LostOutcome::kRight;
    const bool wrong = trial.outcome == pipeline::LostOutcome::kWrong;
    panel.marks.push_back(
        {{trial.T_map_start.x, trial.T_map_start.y},
         right ? Look::kGood : (wrong ? Look::kBad : Look::kOpen)});
    if (right) continue;
    std::string believed = "none";
    if (!trial.places.empty()) believed = words(trial.places.front().T_map_base.mean);
    if (trial.T_map_claimed) believed = words(*trial.T_map_claimed);
    misses.rows.push_back(
        {toString(trial.outcome),
         words(trial.T_map_start),
         words(trial.T_map_end),
         believed,
         trial.places.empty() ? "" : fixed(trial.places.front().weight, 3),
         fixed(trial.driven_m, 1)});
  }
  constexpr double kWidth = 900.0;
  section.pictures.push_back(
      {"Green: right. Orange: not sure after all that was allowed. Red: sure of a wrong place.",
       gui_headless::renderMapSheet({panel}, 1, kWidth)});
  if (!misses.rows.empty()) section.tables.push_back(std::move(misses));
  return section;
}

double areaOf(const grid::OccupancyMap& map) {
  return map.width() * map.resolution() * map.height() * map.resolution();
}

using Bench = std::vector<pipeline::LostTrial> (*)(
    const pipeline::LostPlace&,
    const pipeline::Config&,
    int,
    std::uint64_t,
    const pipeline::Progress&);

void runLost(const std::string& command, Bench bench, const Arguments& args, int& exit_code) {
  pipeline::Config config = pipeline::loadConfig(args.config);
  config.seed = args.seed;
  RunOutput output(args.out, command, config);
  std::vector<std::vector<std::string>> table{
      {"place",
       "right %",
       "wrong %",
       "unsure %",
       "driven m p50/p95",
       "time s p50/p95",
       "searches p50"}};
  Json timing;
  bool good = true;
  gui_headless::Report report;
  report.title = "Vestibule: " + command;
  report.subtitle = "robots that do not know where they are";
  const auto run = [&](const pipeline::LostPlace& place) {
    const std::string& name = place.name;
    ProgressBar bar(name);
    const auto trials = bench(place, config, args.places, args.seed, bar.callback());
    const Share right = shareOf(trials, pipeline::LostOutcome::kRight, args.seed);
    const Share wrong = shareOf(trials, pipeline::LostOutcome::kWrong, args.seed);
    const Share unsure = shareOf(trials, pipeline::LostOutcome::kUnsure, args.seed);
    good = good && right.value >= kRightBar && wrong.value <= kWrongBar;
    std::vector<double> driven;
    std::vector<double> elapsed;
    std::vector<double> searches;
    std::vector<double> first;
    Json list = Json::array();
    for (const auto& trial : trials) {
      driven.push_back(trial.driven_m);
      elapsed.push_back(trial.elapsed_s);
      searches.push_back(trial.searches);
      first.push_back(trial.first_search_s);
      Json t;
      t["outcome"] = toString(trial.outcome);
      t["start"] = toJson(trial.T_map_start);
      t["end"] = toJson(trial.T_map_end);
      if (trial.T_map_claimed) t["claimed"] = toJson(*trial.T_map_claimed);
      t["error_m"] = rounded(trial.error_m, 4);
      t["error_deg"] = rounded(radToDeg(trial.error_rad), 3);
      t["driven_m"] = rounded(trial.driven_m, 3);
      t["searches"] = trial.searches;
      if (trial.outcome != pipeline::LostOutcome::kRight) {
        t["state"] = std::string(amcl::toString(trial.state));
        t["places"] = placesJson(trial.places);
      }
      list.push_back(t);
    }
    table.push_back(
        {name,
         percent(right),
         percent(wrong),
         percent(unsure),
         fixed(quantile(driven, 0.5), 1) + " / " + fixed(quantile(driven, 0.95), 1),
         fixed(quantile(elapsed, 0.5), 1) + " / " + fixed(quantile(elapsed, 0.95), 1),
         fixed(quantile(searches, 0.5), 0)});
    Json s;
    s["places"] = trials.size();
    s["right"] = rounded(right.value, 5);
    s["wrong"] = rounded(wrong.value, 5);
    s["unsure"] = rounded(unsure.value, 5);
    s["driven_m_p50"] = rounded(quantile(driven, 0.5), 3);
    s["driven_m_p95"] = rounded(quantile(driven, 0.95), 3);
    s["elapsed_s_p50"] = rounded(quantile(elapsed, 0.5), 3);
    s["elapsed_s_p95"] = rounded(quantile(elapsed, 0.95), 3);
    s["trials"] = list;
    output.summary()["places"][name] = s;
    auto section = lostSection(*place.map, name, trials);
    section.figures = {
        shareFigure("right", right, right.value >= kRightBar, ">= 98"),
        shareFigure("confident but wrong", wrong, wrong.value <= kWrongBar, "<= 0.5"),
        shareFigure("not sure at the end", unsure),
        figure("driven, median", fixed(quantile(driven, 0.5), 1), "m"),
        figure("driven, 95 %", fixed(quantile(driven, 0.95), 1), "m"),
        figure("time, median", fixed(quantile(elapsed, 0.5), 1), "s"),
        figure("time, 95 %", fixed(quantile(elapsed, 0.95), 1), "s"),
        figure("searches of the map, median", fixed(quantile(searches, 0.5), 0))};
    if (quantile(first, 1.0) > 0.0) {
      timing[name]["first_search_s_p50"] = rounded(quantile(first, 0.5), 4);
      timing[name]["first_search_s_max"] = rounded(quantile(first, 1.0), 4);
      const double bar_s = std::max(1.0, areaOf(*place.map) / kSearchBar_m2ps);
      section.figures.push_back(
          figureAtMost("first search (wall time), median", quantile(first, 0.5), 2, "s", bar_s));
      section.figures.push_back(
          figure("first search (wall time), longest", fixed(quantile(first, 1.0), 2), "s"));
    }
    report.sections.push_back(std::move(section));
  };
  for (const pipeline::LostPlace& place : pipeline::lostPlaces(args.maps, args.worlds, args.seed)) {
    run(place);
  }
  output.text("timing.json", timing.dump(2) + "\n");
  output.report(report);
  output.finish();
  std::printf(
      "%s\n%s\nreport: %s\n",
      textTable(table).c_str(),
      timing.dump(2).c_str(),
      output.pathOf("report.html").c_str());
  exit_code = good ? kDone : kFailedPurpose;
}

void addLost(
    CLI::App& bench,
    const std::string& name,
    const std::string& description,
    int places,
    Bench function,
    int& exit_code) {
  auto args = std::make_shared<Arguments>();
  args->places = places;
  CLI::App* command = bench.add_subcommand(name, description);
  command->add_option("--map", args->maps, "map_server YAML; its truth is a changed copy");
  command->add_option("--world", args->worlds, "simulated world with a given map");
  command->add_option("--places", args->places, "trials per map")->check(CLI::Range(1, 100000));
  command->add_option("--seed", args->seed, "of places, drives and noise");
  command->add_option("--config", args->config, "YAML as config/default.yaml");
  command->add_option("--out", args->out, "output folder")->required();
  command->callback([args, name, function, &exit_code] {
    if (args->maps.empty() && args->worlds.empty()) {
      throw ConfigError("bench " + name + ": nothing to search in; give --map or --world");
    }
    runLost("bench " + name, function, *args, exit_code);
  });
}

}  // namespace

void addBench(CLI::App& app, int& exit_code) {
  CLI::App* bench = app.add_subcommand("bench", "measures what the program can do, with bars");
  bench->require_subcommand(1);
  addLost(
      *bench,
      "global",
      "robots put at random places of maps: how often do they find themselves?",
      200,
      pipeline::benchGlobal,
      exit_code);
  addLost(
      *bench,
      "kidnap",
      "robots carried elsewhere while they drive: do they notice and find themselves?",
      100,
      pipeline::benchKidnap,
      exit_code);
  addBenchLost(*bench, exit_code);
  addBenchSuite(*bench, exit_code);
}

}  // namespace vestibule::app
