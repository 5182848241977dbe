#include "commands.hpp"

namespace vestibule::app {

void addBench(CLI::App& app, int& exit_code) {
  CLI::App* bench = app.add_subcommand("bench", "measures what the program can do, with bars");
  bench->require_subcommand(1);
  addBenchLost(*bench, exit_code);
}

}  // namespace vestibule::app
