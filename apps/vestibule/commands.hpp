#pragma once

#include <CLI/App.hpp>
#include <string>

namespace vestibule::app {

/// Exit codes of the command line.
inline constexpr int kDone = 0;
inline constexpr int kFailedPurpose = 1;  ///< lost, mission aborted, interrupted
inline constexpr int kBadUsage = 2;
inline constexpr int kBadInput = 3;

/// Each adds its subcommand; the subcommand's callback sets `exit_code`.
void addConvert(CLI::App& app, int& exit_code);
void addDemo(CLI::App& app, int& exit_code);
void addInfo(CLI::App& app, int& exit_code);
void addLocalize(CLI::App& app, int& exit_code);
void addFuse(CLI::App& app, int& exit_code);
void addMap(CLI::App& app, int& exit_code);
void addMission(CLI::App& app, int& exit_code);
void addReplay(CLI::App& app, int& exit_code);
void addSim(CLI::App& app, int& exit_code);
void addEval(CLI::App& app, int& exit_code);
void addBench(CLI::App& app, int& exit_code);
void addCalibrate(CLI::App& app, int& exit_code);
void addTune(CLI::App& app, int& exit_code);
void addBenchLost(CLI::App& bench, int& exit_code);   ///< a subcommand of bench
void addBenchSuite(CLI::App& bench, int& exit_code);  ///< a subcommand of bench

/// Root of the source tree: shipped configuration, worlds and recordings.
[[nodiscard]] inline std::string shipped(const std::string& relative) {
  return std::string(VESTIBULE_ROOT) + "/" + relative;
}

}  // namespace vestibule::app
