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
  std::string scenario = "office_nominal";
  std::string config;
  std::string out;
  int drives = 50;
  std::uint64_t seed = 1;
};

std::string reliabilityDiagram(const pipeline::Reliability& r) {
  gui_headless::LineChart chart;
  chart.title = "Reliability of the probability of being lost";
  chart.x_label = "what it said";
  chart.y_label = "how often it was so";
  chart.share = true;
  gui_headless::Series measured{"measured", gui_headless::SeriesLook::kEstimate, {}};
  for (const auto& bin : r.bins) {
    if (bin.samples > 0) measured.points.emplace_back(bin.mean_probability, bin.lost_share);
  }
  chart.series.push_back(measured);
  chart.series.push_back(
      {"perfect", gui_headless::SeriesLook::kReference, {{0.0, 0.0}, {1.0, 1.0}}});
  return gui_headless::lineChart(chart);
}

void runBenchLost(const Arguments& args, int& exit_code) {
  pipeline::Config config = pipeline::loadConfig(args.config);
  config.seed = args.seed;
  RunOutput output(args.out, "bench lost", config);
  std::vector<pipeline::LostSample> samples;
  {
    ProgressBar bar("bench lost");
    samples = pipeline::sampleLost(
        args.scenario, shipped("config/scenarios"), args.drives, config, bar.callback());
  }
  const pipeline::Reliability r = pipeline::reliabilityOf(samples);

  gui_headless::Table bins{
      "Samples by what the localizer said", {"said", "samples", "mean", "was lost"}, {}};
  for (std::size_t b = 0; b < r.bins.size(); ++b) {
    const auto n = static_cast<double>(r.bins.size());
    bins.rows.push_back(
        {fixed(static_cast<double>(b) / n, 1) + " to " + fixed(static_cast<double>(b + 1) / n, 1),
         std::to_string(r.bins[b].samples),
         fixed(r.bins[b].mean_probability, 3),
         fixed(r.bins[b].lost_share, 3)});
  }
  struct Sum {
    double n = 0.0, lost = 0.0, said = 0.0;
  };
  std::map<pipeline::Trouble, Sum> by_trouble;
  for (const auto& s : samples) {
    Sum& sum = by_trouble[s.trouble];
    sum.n += 1.0;
    sum.lost += s.lost ? 1.0 : 0.0;
    sum.said += s.probability;
  }
  gui_headless::Table troubles{
      "By trouble", {"trouble", "samples", "was lost", "said on average"}, {}};
  for (const auto& [trouble, sum] : by_trouble) {
    troubles.rows.push_back(
        {std::string(pipeline::toString(trouble)),
         fixed(sum.n, 0),
         fixed(sum.lost / sum.n, 3),
         fixed(sum.said / sum.n, 3)});
    output.summary()["troubles"][std::string(pipeline::toString(trouble))] = {
        {"samples", sum.n},
        {"lost_share", rounded(sum.lost / sum.n, 4)},
        {"mean_probability", rounded(sum.said / sum.n, 4)}};
  }

  Json& s = output.summary();
  s["scenario"] = args.scenario;
  s["drives"] = args.drives;
  s["samples"] = samples.size();
  s["lost_share"] = rounded(r.lost_share, 4);
  s["expected_calibration_error"] = rounded(r.expected_calibration_error, 4);
  s["brier_score"] = rounded(r.brier_score, 4);

  gui_headless::ReportSection section;
  section.title = "Is the localizer lost, and does it know?";
  section.figures = {
      figureAtMost(
          "expected calibration error", r.expected_calibration_error, 3, "", kCalibrationBar),
      figure("Brier score", fixed(r.brier_score, 3)),
      figure("samples", std::to_string(samples.size())),
      figure("of them lost", fixed(100.0 * r.lost_share, 1), "%")};
  section.charts = {reliabilityDiagram(r)};
  section.tables = {bins, troubles};
  gui_headless::Report report;
  report.title = "Vestibule: bench lost";
  report.subtitle = args.scenario;
  report.sections.push_back(section);
  output.report(report);
  output.finish();
  std::printf(
      "%zu samples, %.1f %% lost; expected calibration error %.3f (bar %.2f), Brier score %.3f\n"
      "report: %s\n",
      samples.size(),
      100.0 * r.lost_share,
      r.expected_calibration_error,
      kCalibrationBar,
      r.brier_score,
      output.pathOf("report.html").c_str());
  exit_code = r.expected_calibration_error <= kCalibrationBar ? kDone : kFailedPurpose;
}

}  // namespace

void addBenchLost(CLI::App& bench, int& exit_code) {
  auto args = std::make_shared<Arguments>();
  CLI::App* command = bench.add_subcommand(
      "lost",
      "crowds, kidnaps, wrong starts and wrong maps: is the probability of being lost right?");
  command->add_option("--scenario", args->scenario, "scenario with a site and a given map");
  command->add_option("--drives", args->drives, "simulated drives")->check(CLI::Range(1, 100000));
  command->add_option("--seed", args->seed, "of troubles, drives and noise");
  command->add_option("--config", args->config, "YAML as config/default.yaml");
  command->add_option("--out", args->out, "output folder")->required();
  command->callback([args, &exit_code] { runBenchLost(*args, exit_code); });
}

}  // namespace vestibule::app
