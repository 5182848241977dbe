#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <sstream>
#include <string>
#include <vector>

#include "commands.hpp"
#include "terminal.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/params.hpp"

namespace {

/// One "vestibule: ..." line per problem.
void printProblems(const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::fprintf(stderr, "vestibule: %s\n", line.c_str());
  }
}

/// What was wrong with the command line, and what to type instead.
std::string explain(const CLI::ParseError& error, const CLI::App& app, const std::string& word) {
  std::vector<std::string> commands;
  for (const CLI::App* command : app.get_subcommands({})) commands.push_back(command->get_name());
  const bool known = std::find(commands.begin(), commands.end(), word) != commands.end();
  if (!known && !word.empty() && word[0] != '-') {
    const auto near = vestibule::nearestWord(word, commands);
    return "'" + word + "' is not a command" + (near ? " (did you mean " + *near + "?)" : "") +
           "; 'vestibule --help' lists them";
  }
  return std::string(error.what()) + "; see 'vestibule" + (known ? " " + word : "") + " --help'";
}

int run(int argc, char** argv) {
  using namespace vestibule::app;
  CLI::App app{
      "Vestibule tells a ground robot where it is indoors, outdoors and through the door between,\n"
      "and drives missions that cross that door.",
      "vestibule"};
  app.require_subcommand(1);
  app.footer(
      "Exit codes: 0 done, 1 the run failed its purpose, 2 bad usage or configuration, 3 bad "
      "input.\n"
      "'vestibule COMMAND --help' explains a command; the manual is in docs/.\n"
      "The wrapper ./vestibule also knows: test (build and run all tests) and build.");
  int exit_code = kDone;
  addDemo(app, exit_code);
  addInfo(app, exit_code);
  addLocalize(app, exit_code);
  addFuse(app, exit_code);
  addMap(app, exit_code);
  addMission(app, exit_code);
  addReplay(app, exit_code);
  addSim(app, exit_code);
  addEval(app, exit_code);
  addBench(app, exit_code);
  addConvert(app, exit_code);
  addTune(app, exit_code);
  addCalibrate(app, exit_code);
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& e) {
    return app.exit(e);
  } catch (const CLI::CallForAllHelp& e) {
    return app.exit(e);
  } catch (const CLI::ParseError& e) {
    printProblems(explain(e, app, argc > 1 ? argv[1] : ""));
    return kBadUsage;
  }
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  vestibule::app::installSignalHandlers();
  vestibule::app::noteCommandLine(argc, argv);
  try {
    return run(argc, argv);
  } catch (const vestibule::app::Interrupted& e) {
    printProblems(e.what());
    return vestibule::app::kFailedPurpose;
  } catch (const vestibule::ConfigError& e) {
    printProblems(e.what());
    return vestibule::app::kBadUsage;
  } catch (const vestibule::InputError& e) {
    printProblems(e.what());
    return vestibule::app::kBadInput;
  } catch (const std::exception& e) {
    printProblems(std::string("unexpected: ") + e.what());
    return vestibule::app::kBadInput;
  }
}
