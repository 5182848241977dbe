#include "cli_fixture.hpp"

namespace vestibule::test {

CommandResult Cli::run(const std::vector<std::string>& arguments) const {
  return runCommand(commandLine(arguments), folder_.path());
}

std::vector<std::string> Cli::commandLine(const std::vector<std::string>& arguments) {
  std::vector<std::string> command{VESTIBULE_BINARY};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return command;
}

std::string Cli::roomMap() const {
  constexpr int kSize = 80;
  std::string image = "P5\n80 80\n255\n";
  for (int row = 0; row < kSize; ++row) {
    for (int column = 0; column < kSize; ++column) {
      const bool wall = row == 0 || column == 0 || row == kSize - 1 || column == kSize - 1;
      image += wall ? '\0' : '\xfe';
    }
  }
  file("room.pgm", image);
  return file(
      "room.yaml",
      "image: room.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
      "occupied_thresh: 0.65\nfree_thresh: 0.196\n");
}

std::string Cli::shortMission() const {
  return file(
      "short.yaml",
      "name: through the west door\n"
      "site: " +
          shipped("config/sites/farm.yaml") + "\n" + "sim: " + shipped("config/sim/rtk.yaml") +
          "\n" +
          "start: {x: -7.0, y: 7.0, yaw_deg: 0.0}\n"
          "paths:\n"
          "  - name: in\n"
          "    waypoints:\n"
          "      outside: {x: -4.0, y: 7.0}\n"
          "      inside: {x: 4.5, y: 7.0}\n"
          "    task: {type: photo, file: inside.png}\n");
}

std::string Cli::missionTo(const std::string& waypoint) const {
  return file(
      "mission.yaml",
      "name: one waypoint\n"
      "site: " +
          shipped("config/sites/farm.yaml") + "\n" +
          "start: {x: -24.0, y: -2.0, yaw_deg: 0.0}\n"
          "paths:\n"
          "  - name: there\n"
          "    waypoints:\n"
          "      goal: " +
          waypoint + "\n");
}

void Cli::expectNoOutput(const std::string& out) const {
  EXPECT_THAT(finalFiles(path(out)), testing::IsEmpty());
}

}  // namespace vestibule::test
