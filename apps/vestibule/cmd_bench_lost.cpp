#include <cstdio>
#include <map>
#include <memory>

#include "commands.hpp"
#include "run_output.hpp"
#include "terminal.hpp"
#include "vestibule/gui_headless/charts.hpp"
#include "vestibule/pipeline/lost_bench.hpp"

namespace vestibule::app {
namespace {

constexpr double kCalibrationBar = 0.05;

struct Arguments {
  std::vector<std::string> maps;
  std::vector<std::string> worlds;
  std::string config;
  std::string out;
  int drives = 50;
  std::uint64_t seed = 1;
  bool fit = false;
};

using Samples = std::vector<pipeline::LostSample>;

std::string reliabilityDiagram(const pipeline::Reliability& r) {
  gui_headless::LineChart chart;
  chart.title = "Reliability of the probability of being lost";
  chart.x_label = "what it said";
  chart.y_label = "how often it was so";
  chart.share = true;
  gui_headless::Series measured{"measured", gui_headless::SeriesLook::kEstimate, {}};
  for (const auto& bin : r.bins) {
    if (bin.weight > 0.0) measured.points.emplace_back(bin.mean_probability, bin.lost_share);
  }
  chart.series.push_back(measured);
  chart.series.push_back(
      {"perfect", gui_headless::SeriesLook::kReference, {{0.0, 0.0}, {1.0, 1.0}}});
  return gui_headless::lineChart(chart);
}

gui_headless::Table binTable(const pipeline::Reliability& r) {
  gui_headless::Table table{
      "Samples by what the localizer said", {"said", "share %", "mean", "was lost"}, {}};
  const auto n = static_cast<double>(r.bins.size());
  for (std::size_t b = 0; b < r.bins.size(); ++b) {
    table.rows.push_back(
        {fixed(static_cast<double>(b) / n, 1) + " to " + fixed(static_cast<double>(b + 1) / n, 1),
         fixed(100.0 * r.bins[b].weight, 1),
         fixed(r.bins[b].mean_probability, 3),
         fixed(r.bins[b].lost_share, 3)});
  }
  return table;
}

gui_headless::Table troubleTable(const std::vector<Samples>& places, Json& summary) {
  struct Sum {
    double n = 0.0, lost = 0.0, said = 0.0;
  };
  std::map<pipeline::Trouble, Sum> by_trouble;
  for (const Samples& samples : places) {
    for (const pipeline::LostSample& s : samples) {
      Sum& sum = by_trouble[s.trouble];
      sum.n += 1.0;
      sum.lost += s.lost ? 1.0 : 0.0;
      sum.said += s.probability;
    }
  }
  gui_headless::Table table{
      "By trouble", {"trouble", "samples", "was lost", "said on average"}, {}};
  for (const auto& [trouble, sum] : by_trouble) {
    const std::string name(toString(trouble));
    table.rows.push_back(
        {name, fixed(sum.n, 0), fixed(sum.lost / sum.n, 3), fixed(sum.said / sum.n, 3)});
    summary[name] = {
        {"samples", sum.n},
        {"lost_share", rounded(sum.lost / sum.n, 4)},
        {"mean_probability", rounded(sum.said / sum.n, 4)}};
  }
  return table;
}

std::string samplesCsv(const std::vector<std::string>& names, const std::vector<Samples>& places) {
  std::string csv =
      "place,drive,trouble,driven_m,error_m,error_deg,lost,probability,inlier_share,"
      "agreeing_share,slow_agreeing_share,sharp_share,slow_blocked_share,worst_blocked_share,"
      "off_map_share,spread_m,weakest_sigma_m\n";
  for (std::size_t i = 0; i < places.size(); ++i) {
    for (const pipeline::LostSample& s : places[i]) {
      csv += names[i] + "," + std::to_string(s.drive) + "," + std::string(toString(s.trouble)) +
             "," + fixed(s.driven_m, 2) + "," + fixed(s.error_m, 3) + "," +
             fixed(radToDeg(s.error_rad), 2) + "," + (s.lost ? "1" : "0") + "," +
             fixed(s.probability, 4);
      const amcl::LostEvidence& e = s.evidence;
      for (const double value :
           {e.inlier_share,
            e.agreeing_share,
            e.slow_agreeing_share,
            e.sharp_share,
            e.slow_blocked_share,
            e.worst_blocked_share,
            e.off_map_share,
            e.spread_m,
            e.weakest_sigma_m}) {
        csv += "," + fixed(value, 4);
      }
      csv += "\n";
    }
  }
  return csv;
}

void runBenchLost(const Arguments& args, int& exit_code) {
  pipeline::Config config = pipeline::loadConfig(args.config);
  config.seed = args.seed;
  std::vector<std::string> worlds = args.worlds;
  if (args.maps.empty() && worlds.empty()) {
    for (const char* world : {"office", "farm", "warehouse_yard", "small_town", "campus"}) {
      worlds.push_back(shipped("config/worlds/" + std::string(world) + ".yaml"));
    }
  }
  RunOutput output(args.out, "bench lost", config);
  std::vector<std::string> names;
  std::vector<Samples> places;
  for (const auto& place : pipeline::lostPlaces(args.maps, worlds, args.seed)) {
    ProgressBar bar(place.name);
    names.push_back(place.name);
    places.push_back(pipeline::sampleLost(place, config, args.drives, args.seed, bar.callback()));
  }
  const pipeline::Reliability all = pipeline::reliabilityOf(places);
  const bool others = args.fit && places.size() > 1;
  const auto by_others = others ? pipeline::judgedByOthers(places) : places;

  Json& s = output.summary();
  s["drives_per_place"] = args.drives;
  s["lost_share"] = rounded(all.lost_share, 4);
  s["expected_calibration_error"] = rounded(all.expected_calibration_error, 4);
  s["brier_score"] = rounded(all.brier_score, 4);
  s["skill"] = rounded(all.skill, 4);
  gui_headless::Table table{
      "By place",
      {"place", "samples", "was lost %", "calibration error", "Brier score", "skill"},
      {}};
  if (others) table.header.push_back("calibration error of a fit to the others");
  for (std::size_t i = 0; i < places.size(); ++i) {
    const pipeline::Reliability r = pipeline::reliabilityOf({places[i]});
    table.rows.push_back(
        {names[i],
         std::to_string(places[i].size()),
         fixed(100.0 * r.lost_share, 1),
         fixed(r.expected_calibration_error, 3),
         fixed(r.brier_score, 3),
         fixed(r.skill, 2)});
    Json p{
        {"samples", places[i].size()},
        {"lost_share", rounded(r.lost_share, 4)},
        {"expected_calibration_error", rounded(r.expected_calibration_error, 4)},
        {"brier_score", rounded(r.brier_score, 4)},
        {"skill", rounded(r.skill, 4)}};
    if (others) {
      const double e = pipeline::reliabilityOf({by_others[i]}).expected_calibration_error;
      table.rows.back().push_back(fixed(e, 3));
      p["expected_calibration_error_by_others"] = rounded(e, 4);
    }
    s["places"][names[i]] = p;
  }
  gui_headless::Table troubles = troubleTable(places, s["troubles"]);
  std::string fitted;
  if (args.fit) {
    const amcl::LostFeatures weights = pipeline::fitLostModel(places);
    for (const double w : weights) {
      s["fitted_weights"].push_back(rounded(w, 3));
      fitted += (fitted.empty() ? "" : ", ") + fixed(w, 3);
    }
  }

  gui_headless::ReportSection section;
  section.title = "Is the localizer lost, and does it know?";
  section.figures = {
      figureAtMost(
          "expected calibration error", all.expected_calibration_error, 3, "", kCalibrationBar),
      figure("Brier score", fixed(all.brier_score, 3)),
      figure("skill: 0 = always saying the mean, 1 = always right", fixed(all.skill, 2)),
      figure("lost", fixed(100.0 * all.lost_share, 1), "%")};
  if (others) {
    const double e = pipeline::reliabilityOf(by_others).expected_calibration_error;
    s["expected_calibration_error_by_others"] = rounded(e, 4);
    section.figures.push_back(
        figure("expected calibration error where nobody fitted it", fixed(e, 3)));
  }
  section.charts = {reliabilityDiagram(all)};
  section.tables = {table, binTable(all), std::move(troubles)};
  gui_headless::Report report;
  report.title = "Vestibule: bench lost";
  report.subtitle = std::to_string(places.size()) + " places, " + std::to_string(args.drives) +
                    " drives in each; every place counts the same";
  report.sections.push_back(section);
  output.text("samples.csv", samplesCsv(names, places));
  output.report(report);
  output.finish();
  std::vector<std::vector<std::string>> rows{table.header};
  rows.insert(rows.end(), table.rows.begin(), table.rows.end());
  std::printf("%s\n", textTable(rows).c_str());
  if (!fitted.empty()) std::printf("fitted weights: %s\n", fitted.c_str());
  std::printf(
      "all places: %.1f %% lost; expected calibration error %.3f (bar %.2f), Brier score %.3f, "
      "skill %.2f\n"
      "report: %s\n",
      100.0 * all.lost_share,
      all.expected_calibration_error,
      kCalibrationBar,
      all.brier_score,
      all.skill,
      output.pathOf("report.html").c_str());
  exit_code = all.expected_calibration_error <= kCalibrationBar ? kDone : kFailedPurpose;
}

}  // namespace

void addBenchLost(CLI::App& bench, int& exit_code) {
  auto args = std::make_shared<Arguments>();
  CLI::App* command = bench.add_subcommand(
      "lost",
      "crowds, kidnaps, wrong starts and wrong maps: is the probability of being lost right?");
  command->add_option("--map", args->maps, "map_server YAML; its truth is a changed copy");
  command->add_option(
      "--world",
      args->worlds,
      "simulated world with given maps; all shipped ones when neither is given");
  command->add_option("--drives", args->drives, "simulated drives per place, of 40 m")
      ->check(CLI::Range(1, 100000));
  command->add_flag(
      "--fit",
      args->fit,
      "also fit the model to these drives, and say how right such a fit is in a place it has not "
      "seen");
  command->add_option("--seed", args->seed, "of troubles, drives and noise");
  command->add_option("--config", args->config, "YAML as config/default.yaml");
  command->add_option("--out", args->out, "output folder")->required();
  command->callback([args, &exit_code] { runBenchLost(*args, exit_code); });
}

}  // namespace vestibule::app
