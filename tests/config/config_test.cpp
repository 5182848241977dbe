// Every YAML the project ships loads, and config/default.yaml lists every parameter's default.

#include "vestibule/pipeline/config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "test_files.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/io/csv_mapping.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/mapping/gmapping_names.hpp"
#include "vestibule/pipeline/mission.hpp"
#include "vestibule/sim/scenario.hpp"
#include "vestibule/sim/simulator.hpp"
#include "vestibule/sim/world.hpp"
#include "vestibule/tuning/session.hpp"
#include "vestibule/tuning/suite.hpp"

namespace vestibule {
namespace {

namespace fs = std::filesystem;
using test::shipped;

/// "ekf.gnss.uere_m" -> "2.5" for every leaf.
using Leaves = std::map<std::string, std::string>;

void collectLeaves(const YAML::Node& node, const std::string& path, Leaves& leaves) {
  if (node.IsMap()) {
    for (const auto& entry : node) {
      const std::string key = entry.first.Scalar();
      collectLeaves(entry.second, path.empty() ? key : path + "." + key, leaves);
    }
  } else if (node.IsSequence()) {
    std::string text = "[";
    for (const auto& element : node) text += (text.size() > 1 ? ", " : "") + element.Scalar();
    leaves[path] = text + "]";
  } else {
    leaves[path] = node.Scalar();
  }
}

Leaves leavesOf(const std::string& yaml) {
  Leaves leaves;
  collectLeaves(YAML::Load(yaml), "", leaves);
  return leaves;
}

/// YAML files below a folder of the source tree, sorted, relative to the source tree.
std::vector<std::string> yamlFiles(const std::string& folder) {
  std::vector<std::string> names;
  for (const std::string& name : test::finalFiles(shipped(folder))) {
    const std::string extension = fs::path(name).extension().string();
    if (extension == ".yaml" || extension == ".yml") {
      names.push_back((fs::path(folder) / name).string());
    }
  }
  return names;
}

TEST(ShippedConfig, DefaultYamlIsTheDefaults) {
  const std::string path = shipped("config/default.yaml");
  const std::string loaded = dumpParams(loadParams<pipeline::Config>(path));
  const std::string defaults = dumpParams(pipeline::Config{});
  const Leaves in_file = leavesOf(test::readFile(path));
  const Leaves loaded_values = leavesOf(loaded);
  std::string changes;
  for (const auto& [key, value] : leavesOf(defaults)) {
    if (in_file.count(key) == 0) {
      changes += "  add    " + key + ": " + value + "\n";
    } else if (loaded_values.at(key) != value) {
      changes += "  change " + key + ": " + in_file.at(key) + " -> " + value + "\n";
    }
  }
  EXPECT_TRUE(changes.empty())
      << "config/default.yaml no longer lists the defaults in the code. Edit it:\n"
      << changes << "(every run writes the same YAML, without comments, as config.resolved.yaml)";
  EXPECT_TRUE(loaded == defaults);
}

TEST(ShippedConfig, ResolvedConfigurationLoadsToItself) {
  pipeline::Config config;
  config.seed = 77;
  config.rig.T_base_laser = {0.35, -0.1, 0.3};
  config.ekf.gnss.uere_m = 3.25;
  config.driver.max_speed_mps = 0.55;
  const std::string once = dumpParams(config);
  EXPECT_NE(once, dumpParams(pipeline::Config{}));
  EXPECT_EQ(dumpParams(parseParams<pipeline::Config>(once, "config.resolved.yaml")), once);
}

/// Every shipped YAML, by its folder; a new kind of file needs a loader here.
const std::vector<std::pair<std::string, std::function<void(const std::string&)>>>& loaders() {
  static const std::vector<std::pair<std::string, std::function<void(const std::string&)>>> kAll{
      {"config/csv", [](const std::string& path) { (void)loadParams<io::CsvMapping>(path); }},
      {"config/filters", [](const std::string& path) { (void)pipeline::loadConfig(path); }},
      {"config/gmapping",
       [](const std::string& path) { (void)loadParams<mapping::GmappingNames>(path); }},
      {"config/sim", [](const std::string& path) { (void)loadParams<sim::SimParams>(path); }},
      {"config/tuning",
       [](const std::string& path) {
         (void)tuning::loadSession(path, shipped("config/scenarios"));
       }},
      {"config/suites",
       [](const std::string& path) { (void)tuning::loadSuite(path, shipped("config/scenarios")); }},
      {"config/scenarios",
       [](const std::string& path) { (void)sim::loadScenario(path, shipped("config/scenarios")); }},
      {"config/sites", [](const std::string& path) { (void)geo::loadSite(path); }},
      {"config/worlds", [](const std::string& path) { (void)sim::loadWorld(path); }},
      {"config/missions",
       [](const std::string& path) {
         // A mission is checked in the world of its site, which has the site's file name.
         const YAML::Node mission = YAML::LoadFile(path);
         const fs::path site = mission["site"].as<std::string>();
         const std::string world = shipped("config/worlds/" + site.filename().string());
         const auto setup = pipeline::loadMissionSetup(path, world, pipeline::Config{});
         EXPECT_FALSE(setup.mission.paths.empty());
         EXPECT_EQ(setup.map_rectangles.size(), setup.site.indoor_maps.size());
       }},
      {"maps",
       [](const std::string& path) {
         const grid::OccupancyMap map = io::loadMap(path);
         EXPECT_GT(map.count(grid::Cell::kOccupied), 0U);
         EXPECT_GT(map.count(grid::Cell::kFree), 0U);
       }},
  };
  return kAll;
}

TEST(ShippedConfig, EveryFileLoads) {
  for (const auto& [folder, load] : loaders()) {
    const auto files = yamlFiles(folder);
    EXPECT_FALSE(files.empty()) << folder << " has no YAML file";
    for (const std::string& file : files) {
      SCOPED_TRACE(file);
      EXPECT_NO_THROW(load(shipped(file)));
    }
  }
}

TEST(ShippedConfig, EveryFileHasALoader) {
  for (const std::string& file : yamlFiles("config")) {
    const std::string folder = fs::path(file).parent_path().string();
    const bool known = std::any_of(loaders().begin(), loaders().end(), [&](const auto& entry) {
      return entry.first == folder;
    });
    if (known) continue;
    // What lies directly in config/ goes to --config.
    ASSERT_EQ(folder, "config") << file << ": nothing in this test loads it";
    EXPECT_NO_THROW((void)pipeline::loadConfig(shipped(file))) << file;
  }
}

}  // namespace
}  // namespace vestibule
