#include <cstdio>
#include <filesystem>

#include "commands.hpp"
#include "terminal.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/io/recording_info.hpp"

namespace vestibule::app {
namespace {

struct Arguments {
  std::string log;
  bool json = false;
};

}  // namespace

void addInfo(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "info", "what is in a recording: sensors, counts, rates, gaps, time span, problems");
  command->add_option("LOG", args->log, "rawlog, CARMEN log, ROS 1 bag or CSV")->required();
  command->add_flag("--json", args->json, "print JSON instead of a table");
  command->callback([args, &exit_code] {
    io::RecordingOptions options;
    options.csv_mapping_dir = shipped("config/csv");
    io::RecordingInfo info;
    {
      ProgressBar bar("info");
      const auto progress = bar.callback();
      info = io::inspectRecording(
          args->log, options, [&progress](double share) { progress(share, 0.0); });
    }
    std::fputs((args->json ? info.toJson() : info.toText()).c_str(), stdout);
    exit_code = kDone;
  });
}

}  // namespace vestibule::app
