#include "vestibule/sim/scenario.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <future>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::sim {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

const std::string kFolder = std::string(VESTIBULE_SOURCE_DIR) + "/config/scenarios";

/// Every stamp and some content of a run, as one number.
std::uint64_t digest(const Scenario& scenario, std::uint64_t seed, Duration length) {
  ScenarioRun run(scenario, seed);
  std::uint64_t sum = 0;
  const auto add = [&sum](auto value) {
    std::uint64_t bits = 0;
    static_assert(sizeof value == sizeof bits);
    std::memcpy(&bits, &value, sizeof bits);
    sum = (sum ^ bits) * 1099511628211ULL;
  };
  while (!run.finished() && run.simulator().time() < kStartOfTime + length) {
    for (const Delivered& d : run.step(100ms)) {
      add(d.arrival.ns);
      if (const auto* scan = std::get_if<LaserScan>(&d.measurement)) {
        for (const float r : scan->ranges_m) add(static_cast<double>(r));
      } else if (const auto* imu_message = std::get_if<Imu>(&d.measurement)) {
        add(imu_message->omega_radps.z());
      } else if (const auto* fix = std::get_if<GnssFix>(&d.measurement)) {
        add(std::get<Geodetic>(fix->position).lat_deg);
      }
    }
    add(run.simulator().truth().x);
  }
  return sum;
}

TEST(Scenario, EveryShippedOneLoadsAndStarts) {
  const auto names = scenarioNames(kFolder);
  EXPECT_GE(names.size(), 30U);
  for (const std::string& name : names) {
    SCOPED_TRACE(name);
    const Scenario scenario = loadScenario(name, kFolder);
    EXPECT_EQ(scenario.name, name);
    ScenarioRun run(scenario, 1);
    EXPECT_GT(run.simulator().minClearance(), 0.1);
    EXPECT_FALSE(run.step(1s).empty());
  }
}

TEST(Scenario, AnyNumberOfThreadsGivesTheSameBytes) {
  const Scenario scenario = loadScenario("transport_faults", kFolder);
  std::vector<std::uint64_t> alone;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) alone.push_back(digest(scenario, seed, 30s));
  std::vector<std::future<std::uint64_t>> threads;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    threads.push_back(
        std::async(std::launch::async, [&scenario, seed] { return digest(scenario, seed, 30s); }));
  }
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(threads[i].get(), alone[i]);
  EXPECT_NE(alone[0], alone[1]);
}

TEST(Scenario, DrivesWhereItIsTold) {
  Scenario scenario = loadScenario("open_sky", kFolder);
  scenario.repeat = 1;
  ScenarioRun run(scenario, 3);
  double far_m = 0.0;
  while (!run.finished()) {
    (void)run.step(100ms);
    const Pose2& T = run.simulator().truth();
    const double off_m =
        std::min({std::abs(T.y), std::abs(T.x - 60.0), std::abs(T.y - 40.0), std::abs(T.x)});
    far_m = std::max(far_m, off_m);
  }
  EXPECT_LT(far_m, 1.0) << "left the rectangle";
  EXPECT_NEAR(run.simulator().truth().x, 0.0, 0.4);
  EXPECT_NEAR(run.simulator().truth().y, 0.0, 0.4);
  EXPECT_NEAR(run.simulator().distanceDriven(), 200.0, 6.0);
}

TEST(Scenario, IncidentsHappenWhenTheyShould) {
  Scenario scenario = loadScenario("open_sky_rtk", kFolder);
  scenario.incidents.resize(3);
  scenario.incidents[0].at_s = 5.0;
  scenario.incidents[0].kidnap_to = Pose2{100.0, 50.0, 1.0};
  scenario.incidents[1].at_s = 8.0;
  scenario.incidents[1].for_s = 2.0;
  scenario.incidents[1].gnss_blocked = true;
  scenario.incidents[2].at_s = 12.0;
  scenario.incidents[2].for_s = 3.0;
  scenario.incidents[2].reboot = true;
  ScenarioRun run(scenario, 1);
  for (int i = 0; i < 40; ++i) {
    const double before_s = run.elapsed();
    const Pose2 T = run.simulator().truth();
    const auto all = run.step(500ms);
    if (before_s < 4.4) {
      EXPECT_LT(T.x, 6.0);
    }
    if (before_s > 5.4 && before_s < 6.0) {
      EXPECT_GT(T.x, 90.0);
    }
    EXPECT_EQ(all.empty(), before_s > 11.9 && before_s < 14.4) << before_s;
    for (const Delivered& d : all) {
      const auto* fix = std::get_if<GnssFix>(&d.measurement);
      if (fix == nullptr) continue;
      const double stamp_s = toSeconds(fix->stamp - kStartOfTime);
      if (stamp_s > 8.2 && stamp_s < 9.9) {
        EXPECT_EQ(fix->type, GnssFixType::kNone);
      }
      if (stamp_s < 7.9) {
        EXPECT_EQ(fix->type, GnssFixType::kRtkFixed);
      }
    }
  }
}

TEST(Scenario, BadFilesAreRefusedByLine) {
  const std::string path = ::testing::TempDir() + "bad_scenario.yaml";
  std::ofstream(path) << "name: bad\n"
                         "set: filters\n"
                         "world: ../worlds/none.yaml\n"
                         "start: [0, 0]\n"
                         "drive:\n"
                         "  - {to: [1, 1], wait_s: 3}\n"
                         "incidents:\n"
                         "  - {at_s: 3, gnss_blocked: true}\n";
  try {
    (void)loadScenario(path, kFolder);
    FAIL() << "accepted";
  } catch (const ConfigError& e) {
    EXPECT_THAT(e.what(), HasSubstr("bad_scenario.yaml:2: set: must be filter, map or door"));
    EXPECT_THAT(e.what(), HasSubstr("bad_scenario.yaml:4: start"));
    EXPECT_THAT(e.what(), HasSubstr("bad_scenario.yaml:6: drive[0]: a leg has exactly one of"));
    EXPECT_THAT(e.what(), HasSubstr("bad_scenario.yaml:8: incidents[0]: this incident needs"));
  }
  try {
    (void)loadScenario("open_skyy", kFolder);
    FAIL() << "accepted";
  } catch (const ConfigError& e) {
    EXPECT_THAT(e.what(), HasSubstr("did you mean open_sky?"));
  }
}

}  // namespace
}  // namespace vestibule::sim
