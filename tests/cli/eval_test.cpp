// vestibule eval: known errors come out as such.

#include <cmath>
#include <cstdio>

#include "cli_fixture.hpp"

namespace vestibule::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

/// 100 poses on a circle of 5 m, 10 per second, each moved by (dx, dy) in the map.
std::string circle(double dx, double dy) {
  std::string tum = "# timestamp tx ty tz qx qy qz qw\n";
  for (int i = 0; i < 100; ++i) {
    const double a = 0.05 * i;
    const double yaw = a + M_PI / 2.0;
    char line[200];
    std::snprintf(
        line,
        sizeof line,
        "%.9f %.9f %.9f 0 0 0 %.9f %.9f\n",
        1700000000.0 + 0.1 * i,
        5.0 * std::cos(a) + dx,
        5.0 * std::sin(a) + dy,
        std::sin(yaw / 2.0),
        std::cos(yaw / 2.0));
    tum += line;
  }
  return tum;
}

class Eval : public Cli {
 protected:
  json evaluate(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "eval");
    arguments.emplace_back("--json");
    const CommandResult result = run(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.err, "");
    return json::parse(result.out);
  }
};

TEST_F(Eval, ATrajectoryHasNoErrorAgainstItself) {
  const std::string tum = file("a.tum", circle(0, 0));
  const json errors = evaluate({tum, "--ref", tum});
  EXPECT_EQ(errors["schema"], "vestibule.eval");
  EXPECT_EQ(errors["poses"], 100);
  EXPECT_EQ(errors["matched"], 100);
  for (const char* kind : {"ape", "ape_aligned", "rpe_distance", "rpe_time"}) {
    EXPECT_GT(errors[kind]["count"], 0) << kind;
    EXPECT_NEAR(errors[kind]["translation_m"]["max"].get<double>(), 0.0, 1e-6) << kind;
    EXPECT_NEAR(errors[kind]["rotation_deg"]["max"].get<double>(), 0.0, 1e-4) << kind;
  }
}

TEST_F(Eval, AShiftIsTheAbsoluteErrorAndNothingElse) {
  const json errors =
      evaluate({file("moved.tum", circle(0.3, -0.4)), "--ref", file("a.tum", circle(0, 0))});
  EXPECT_NEAR(errors["ape"]["translation_m"]["rmse"].get<double>(), 0.5, 1e-6);
  EXPECT_NEAR(errors["ape"]["translation_m"]["max"].get<double>(), 0.5, 1e-6);
  EXPECT_NEAR(errors["ape"]["rotation_deg"]["max"].get<double>(), 0.0, 1e-4);
  EXPECT_NEAR(errors["ape_aligned"]["translation_m"]["rmse"].get<double>(), 0.0, 1e-6);
  EXPECT_NEAR(errors["rpe_time"]["translation_m"]["max"].get<double>(), 0.0, 1e-6);
}

TEST_F(Eval, RelationsAreComparedPairwise) {
  // GIVEN a straight drive at 1 m/s, and relations of which one is 0.2 m and 0.1 rad off
  std::string tum;
  for (int i = 0; i <= 10; ++i) {
    tum += std::to_string(i) + " " + std::to_string(i) + " 0 0 0 0 0 1\n";
  }
  const std::string relations = file("drive.relations", "0 4 4.0 0 0 0 0 0\n2 8 6.2 0 0 0 0 0.1\n");
  // THEN the errors are 0 and those
  const json errors = evaluate({file("drive.tum", tum), "--relations", relations});
  EXPECT_EQ(errors["relations_total"], 2);
  EXPECT_EQ(errors["relations_matched"], 2);
  EXPECT_NEAR(errors["relations"]["translation_m"]["mean"].get<double>(), 0.1, 1e-6);
  EXPECT_NEAR(errors["relations"]["translation_m"]["max"].get<double>(), 0.2, 1e-6);
  EXPECT_NEAR(errors["relations"]["rotation_deg"]["max"].get<double>(), 5.729578, 1e-4);
}

TEST_F(Eval, TheTableNamesTheErrors) {
  const std::string tum = file("a.tum", circle(0, 0));
  const CommandResult result = run({"eval", tum, "--ref", tum});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.out, testing::AllOf(HasSubstr("APE"), HasSubstr("RPE"), HasSubstr("rmse")));
}

TEST_F(Eval, NothingToCompareWithIsWrongUsage) {
  const CommandResult result = run({"eval", file("a.tum", circle(0, 0))});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("give --ref, --relations or --odometry"));
}

TEST_F(Eval, TrajectoriesOfDifferentTimesAreBadInput) {
  const std::string other = file("other.tum", "5 0 0 0 0 0 0 1\n6 1 0 0 0 0 0 1\n");
  const CommandResult result = run({"eval", file("a.tum", circle(0, 0)), "--ref", other});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(
      result.err, testing::AllOf(HasSubstr("a.tum: no stamp matches"), HasSubstr("--max-dt")));
}

TEST_F(Eval, AWrongLineIsNamed) {
  const std::string bad = file("bad.tum", "5 0 0 0 0 0 0 1\n6 1 0 0 0 0 1\n");
  const CommandResult result = run({"eval", bad, "--ref", bad});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.err, HasSubstr("bad.tum:2: 7 columns"));
}

}  // namespace
}  // namespace vestibule::test
