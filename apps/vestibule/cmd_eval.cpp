#include <cstdio>
#include <fstream>
#include <memory>

#include "commands.hpp"
#include "run_output.hpp"
#include "terminal.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/metrics/relations.hpp"
#include "vestibule/metrics/transition.hpp"

namespace vestibule::app {
namespace {

struct Arguments {
  std::string estimate;
  std::string reference;
  std::string relations;
  std::string odometry;
  double max_dt_s = 0.01;
  bool interpolate = false;
  double step_m = 1.0;
  double step_s = 1.0;
  bool json = false;
};

void addRow(
    std::vector<std::vector<std::string>>& rows,
    Json& json,
    const std::string& name,
    const std::string& key,
    const metrics::Statistics& m,
    const metrics::Statistics& rad) {
  const double deg = radToDeg(1.0);
  const auto row = [&](const std::string& label, const metrics::Statistics& s, double unit) {
    rows.push_back(
        {label,
         std::to_string(s.count),
         fixed(s.rmse * unit, 4),
         fixed(s.mean * unit, 4),
         fixed(s.stddev * unit, 4),
         fixed(s.median * unit, 4),
         fixed(s.p95 * unit, 4),
         fixed(s.max * unit, 4)});
  };
  row(name + " [m]", m, 1.0);
  row(name + " [deg]", rad, deg);
  json[key]["count"] = m.count;
  json[key]["translation_m"] = toJson(m);
  json[key]["rotation_deg"] = toJson(rad, deg);
}

}  // namespace

void addEval(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "eval", "errors of a trajectory: against a reference, verified relations, its odometry");
  command->add_option("EST", args->estimate, "estimated trajectory (TUM)")->required();
  command->add_option("--ref", args->reference, "reference trajectory (TUM): APE and RPE");
  command->add_option(
      "--relations", args->relations, "verified relative poses: t1 t2 x y z roll pitch yaw");
  command->add_option(
      "--odometry",
      args->odometry,
      "smooth odometry trajectory (TUM): largest correction step per 100 ms");
  command->add_option("--max-dt", args->max_dt_s, "largest difference of matched stamps [s]")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--interpolate", args->interpolate, "interpolate the reference to the stamps");
  command->add_option("--step-m", args->step_m, "distance between the poses of an RPE pair [m]")
      ->check(CLI::PositiveNumber);
  command->add_option("--step-s", args->step_s, "time between the poses of an RPE pair [s]")
      ->check(CLI::PositiveNumber);
  command->add_flag("--json", args->json, "print JSON instead of a table");
  command->callback([args, &exit_code] {
    const auto estimate = readPlanarTum(args->estimate);
    if (args->reference.empty() && args->relations.empty() && args->odometry.empty()) {
      throw ConfigError("eval: give --ref, --relations or --odometry to compare with");
    }
    const Duration max_dt = durationFromSeconds(args->max_dt_s);
    Json json;
    json["schema"] = "vestibule.eval";
    json["schema_version"] = 1;
    json["estimate"] = args->estimate;
    json["poses"] = estimate.size();
    std::vector<std::vector<std::string>> rows{
        {"error", "count", "rmse", "mean", "std", "median", "p95", "max"}};
    std::string notes;
    bool matched = true;
    if (!args->reference.empty()) {
      metrics::AssociationOptions association;
      association.max_dt = max_dt;
      if (args->interpolate) association.matching = metrics::Matching::kInterpolated;
      const auto matches =
          metrics::associate(estimate, readPlanarTum(args->reference), association);
      matched = !matches.empty();
      notes += "matched " + std::to_string(matches.size()) + " of " +
               std::to_string(estimate.size()) + " poses\n";
      const auto raw = metrics::absoluteErrors(matches, metrics::Alignment::kNone);
      const auto aligned = metrics::absoluteErrors(matches, metrics::Alignment::kSe2);
      const auto by_distance = metrics::relativeErrorsOverDistance(matches, args->step_m);
      const auto by_time =
          metrics::relativeErrorsOverTime(matches, durationFromSeconds(args->step_s));
      json["matched"] = matches.size();
      addRow(rows, json, "APE", "ape", raw.translation_m, raw.yaw_rad);
      addRow(
          rows, json, "APE, SE(2) aligned", "ape_aligned", aligned.translation_m, aligned.yaw_rad);
      addRow(
          rows,
          json,
          "RPE per " + fixed(args->step_m, 1) + " m",
          "rpe_distance",
          by_distance.translation_m,
          by_distance.yaw_rad);
      addRow(
          rows,
          json,
          "RPE per " + fixed(args->step_s, 1) + " s",
          "rpe_time",
          by_time.translation_m,
          by_time.yaw_rad);
    }
    if (!args->relations.empty()) {
      std::ifstream in(args->relations);
      if (!in) throw InputError(args->relations + ": cannot be read (missing or no permission)");
      const auto errors =
          metrics::relationErrors(estimate, metrics::parseRelations(in, args->relations), max_dt);
      matched = matched && errors.matched > 0;
      notes += "relations matched " + std::to_string(errors.matched) + " of " +
               std::to_string(errors.relations) + "\n";
      json["relations_total"] = errors.relations;
      json["relations_matched"] = errors.matched;
      addRow(rows, json, "relations", "relations", errors.translation_m, errors.yaw_rad);
    }
    if (!args->odometry.empty()) {
      const auto step = metrics::largestCorrection(estimate, readPlanarTum(args->odometry));
      matched = matched && step.pairs > 0;
      notes += "largest correction within 100 ms: " + fixed(step.position_m, 4) + " m, " +
               fixed(radToDeg(step.yaw_rad), 3) + " deg (" + std::to_string(step.pairs) +
               " pairs)\n";
      json["correction_step"]["position_m"] = rounded(step.position_m, 6);
      json["correction_step"]["yaw_deg"] = rounded(radToDeg(step.yaw_rad), 6);
      json["correction_step"]["pairs"] = step.pairs;
    }
    if (args->json) {
      std::printf("%s\n", json.dump(2).c_str());
    } else {
      if (rows.size() > 1) std::fputs(textTable(rows).c_str(), stdout);
      std::fputs(notes.c_str(), stdout);
    }
    if (!matched) {
      throw InputError(
          args->estimate + ": no stamp matches within " + fixed(args->max_dt_s, 3) +
          " s; are both files of the same recording? --max-dt widens the match");
    }
    exit_code = kDone;
  });
}

}  // namespace vestibule::app
